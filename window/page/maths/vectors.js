/**
 * Vectors are arrays of three numbers, rotations are nine numbers row by row.
 *
 * @typedef {import("../types.js").Vector} Vector
 */

/** @param {Vector} a @param {Vector} b @returns {Vector} */
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

/** @param {Vector} a @param {Vector} b @returns {Vector} */
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

/** @param {Vector} a @param {number} factor @returns {Vector} */
export const scaled = (a, factor) => [a[0] * factor, a[1] * factor, a[2] * factor];

/** a + b · factor. @param {Vector} a @param {Vector} b @param {number} factor @returns {Vector} */
export const moved = (a, b, factor) => [a[0] + b[0] * factor, a[1] + b[1] * factor, a[2] + b[2] * factor];

/** @param {Vector} a @param {Vector} b */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** @param {Vector} a @param {Vector} b @returns {Vector} */
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** @param {Vector} a */
export const length = (a) => Math.hypot(a[0], a[1], a[2]);

/** @param {Vector} a @param {Vector} b */
export const distance = (a, b) => length(subtract(a, b));

/** The unit vector along `a`, or `otherwise` where `a` is zero.
 * @param {Vector} a @param {Vector} [otherwise] @returns {Vector} */
export function normalized(a, otherwise = [0, 0, -1]) {
  const size = length(a);
  return size > 0 ? scaled(a, 1 / size) : otherwise;
}

/** a at 0, b at 1. @param {Vector} a @param {Vector} b @param {number} share @returns {Vector} */
export const mixed = (a, b, share) => moved(a, subtract(b, a), share);

/** Two unit vectors that stand at right angles to unit `axis` and to each other.
 * @param {Vector} axis @returns {[Vector, Vector]} */
export function acrossOf(axis) {
  // The coordinate axis that is farthest from `axis`, so that the cross product is well conditioned.
  /** @type {Vector} */
  const other = Math.abs(axis[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0];
  const first = normalized(cross(other, axis));
  return [first, cross(axis, first)];
}

/** matrix · a. @param {number[]} m @param {Vector} a @returns {Vector} */
export const rotated = (m, a) => [
  m[0] * a[0] + m[1] * a[1] + m[2] * a[2],
  m[3] * a[0] + m[4] * a[1] + m[5] * a[2],
  m[6] * a[0] + m[7] * a[1] + m[8] * a[2],
];

/** The inverse rotation of `a`. @param {number[]} m @param {Vector} a @returns {Vector} */
export const unrotated = (m, a) => [
  m[0] * a[0] + m[3] * a[1] + m[6] * a[2],
  m[1] * a[0] + m[4] * a[1] + m[7] * a[2],
  m[2] * a[0] + m[5] * a[1] + m[8] * a[2],
];

/** m · n. @param {number[]} m @param {number[]} n */
export function product(m, n) {
  const result = [];
  for (let row = 0; row < 9; row += 3) {
    for (let column = 0; column < 3; column += 1) {
      result.push(m[row] * n[column] + m[row + 1] * n[column + 3] + m[row + 2] * n[column + 6]);
    }
  }
  return result;
}

/** The quaternion [x, y, z, w] of a rotation (Shepperd 1978: from the largest component).
 * @param {number[]} m */
export function quaternionOf(m) {
  const [xx, yy, zz] = [m[0], m[4], m[8]];
  const squares = [1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz];
  const largest = squares.indexOf(Math.max(...squares));
  const [yx, zx, zy] = [m[3] + m[1], m[6] + m[2], m[7] + m[5]];
  const [wx, wy, wz] = [m[7] - m[5], m[2] - m[6], m[3] - m[1]];
  const square = squares[largest];
  const q = [
    [square, yx, zx, wx],
    [yx, square, zy, wy],
    [zx, zy, square, wz],
    [wx, wy, wz, square],
  ][largest];
  return q.map((value) => value / (2 * Math.sqrt(square)));
}

/** The rotation of a unit quaternion [x, y, z, w]. @param {number[]} q */
export function rotationOf([x, y, z, w]) {
  return [
    1 - 2 * (y * y + z * z),
    2 * (x * y - z * w),
    2 * (x * z + y * w),
    2 * (x * y + z * w),
    1 - 2 * (x * x + z * z),
    2 * (y * z - x * w),
    2 * (x * z - y * w),
    2 * (y * z + x * w),
    1 - 2 * (x * x + y * y),
  ];
}

/** Between two rotations along the shortest arc (Shoemake 1985). @param {number[]} m @param {number[]} n
 * @param {number} share in [0, 1] */
export function rotationBetween(m, n, share) {
  const [p, q] = [quaternionOf(m), quaternionOf(n)];
  const cosine = p.reduce((sum, value, index) => sum + value * q[index], 0);
  const angle = Math.acos(Math.min(1, Math.abs(cosine)));
  // Below this angle the sine cancels, and a straight line is as good.
  const straight = angle < 1e-4;
  const from = straight ? 1 - share : Math.sin((1 - share) * angle) / Math.sin(angle);
  const to = (straight ? share : Math.sin(share * angle) / Math.sin(angle)) * (cosine < 0 ? -1 : 1);
  const between = p.map((value, index) => from * value + to * q[index]);
  const size = Math.hypot(...between);
  return rotationOf(between.map((value) => value / size));
}
