/**
 * How a camera moves. A camera is `{to_world, yfov}` and is never changed: every function returns another.
 *
 * @typedef {import("../types.js").Vector} Vector
 * @typedef {import("../types.js").Camera} Camera
 * @typedef {{yaw: number, pitch: number, roll: number}} Angles  radians: about Y, then X, then Z
 */
import {
  add,
  cross,
  distance,
  dot,
  length,
  mixed,
  moved,
  product,
  rotated,
  rotationBetween,
  scaled,
  subtract,
  unrotated,
} from "./vectors.js";

/** A tenth of a degree short of straight up and down, so that the heading stays defined. */
export const STEEPEST_PITCH = (89.9 * Math.PI) / 180;
/** What one notch of the wheel leaves of the distance to the surface. A choice. */
export const DOLLY_FACTOR = 0.85;
/** As near as the wheel comes to a surface, in diagonals of the scene. A choice. */
export const NEAREST = 1e-3;
/** As far as the wheel goes from the surface, in diagonals. A choice. */
export const FARTHEST = 20;

/** Where the camera stands. @param {Camera} camera @returns {Vector} */
export const eyeOf = ({ to_world: m }) => [m[3], m[7], m[11]];

/** Its rotation, nine numbers. @param {Camera} camera */
export const turnOf = ({ to_world: m }) => [m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]];

/** The unit vector it looks along. @param {Camera} camera @returns {Vector} */
export const forwardOf = ({ to_world: m }) => [-m[2], -m[6], -m[10]];

/** Its unit vectors to the right and up. @param {Camera} camera @returns {[Vector, Vector]} */
export const sidesOf = ({ to_world: m }) => [
  [m[0], m[4], m[8]],
  [m[1], m[5], m[9]],
];

/** @param {number[]} r @param {Vector} eye @param {number} yfov @returns {Camera} */
export const cameraOf = (r, eye, yfov) => ({
  to_world: [r[0], r[1], r[2], eye[0], r[3], r[4], r[5], eye[1], r[6], r[7], r[8], eye[2], 0, 0, 0, 1],
  yfov,
});

/** @param {Camera} camera @returns {Angles} */
export function anglesOf(camera) {
  const forward = forwardOf(camera);
  const [right] = sidesOf(camera);
  // Straight up or down, the heading is that of the image's right, and there is no roll.
  if (Math.hypot(forward[0], forward[2]) < 1e-6) {
    return { yaw: Math.atan2(-right[2], right[0]), pitch: Math.sign(forward[1]) * (Math.PI / 2), roll: 0 };
  }
  const yaw = Math.atan2(-forward[0], -forward[2]);
  const level = /** @type {Vector} */ ([Math.cos(yaw), 0, -Math.sin(yaw)]);
  return {
    yaw,
    pitch: Math.asin(Math.max(-1, Math.min(1, forward[1]))),
    roll: Math.atan2(dot(right, cross(level, forward)), dot(right, level)),
  };
}

/** @param {Angles} angles @returns {number[]} a rotation */
export function turnBy({ yaw, pitch, roll }) {
  const [cy, sy] = [Math.cos(yaw), Math.sin(yaw)];
  const [cp, sp] = [Math.cos(pitch), Math.sin(pitch)];
  const [cr, sr] = [Math.cos(roll), Math.sin(roll)];
  const heading = [cy, 0, sy, 0, 1, 0, -sy, 0, cy];
  const tilt = [1, 0, 0, 0, cp, -sp, 0, sp, cp];
  return product(product(heading, tilt), [cr, -sr, 0, sr, cr, 0, 0, 0, 1]);
}

/** Turns by `yaw` to the left and `pitch` upwards (radians) where it stands.
 * @param {Camera} camera @param {number} yaw @param {number} pitch */
export function looked(camera, yaw, pitch) {
  const angles = anglesOf(camera);
  const tilted = Math.max(-STEEPEST_PITCH, Math.min(STEEPEST_PITCH, angles.pitch + pitch));
  return cameraOf(
    turnBy({ yaw: angles.yaw + yaw, pitch: tilted, roll: angles.roll }),
    eyeOf(camera),
    camera.yfov,
  );
}

/** The same turn about `pivot`, which stays at its place in the image.
 * @param {Camera} camera @param {Vector} pivot @param {number} yaw @param {number} pitch */
export function orbited(camera, pivot, yaw, pitch) {
  const turned = turnOf(looked(camera, yaw, pitch));
  const seen = unrotated(turnOf(camera), subtract(pivot, eyeOf(camera)));
  return cameraOf(turned, subtract(pivot, rotated(turned, seen)), camera.yfov);
}

/** Moves sideways until `point` lies in direction `ray` (from the eye, any length); its depth stays.
 * @param {Camera} camera @param {Vector} point @param {Vector} ray */
export function panned(camera, point, ray) {
  const forward = forwardOf(camera);
  const depth = dot(subtract(point, eyeOf(camera)), forward);
  const eye = moved(point, ray, -depth / dot(ray, forward));
  return cameraOf(turnOf(camera), eye, camera.yfov);
}

/** Moves towards `target` by `notches` of the wheel, or away where negative. Each notch goes a share of the
 * way, so the target is never reached.
 * @param {Camera} camera @param {Vector} target @param {number} notches @param {number} diagonal */
export function dollied(camera, target, notches, diagonal) {
  const from = distance(eyeOf(camera), target);
  const nearest = Math.min(from, NEAREST * diagonal);
  const to = Math.min(
    nearest + (from - nearest) * DOLLY_FACTOR ** notches + (notches < 0 ? NEAREST * diagonal : 0),
    Math.max(from, FARTHEST * diagonal),
  );
  const eye = mixed(target, eyeOf(camera), from > 0 ? to / from : 1);
  return cameraOf(turnOf(camera), eye, camera.yfov);
}

/** Moves by `step` (right, up, backwards) along its own axes, world units.
 * @param {Camera} camera @param {Vector} step */
export const flown = (camera, step) =>
  cameraOf(turnOf(camera), add(eyeOf(camera), rotated(turnOf(camera), step)), camera.yfov);

/** Looks at the whole box from the side it looks from now.
 * @param {Camera} camera @param {[Vector, Vector]} bounds @param {number} aspect width ÷ height */
export function framed(camera, [low, high], aspect) {
  const radius = length(subtract(high, low)) / 2;
  const half = Math.atan(Math.tan(camera.yfov / 2) * Math.min(1, aspect));
  const eye = moved(scaled(add(low, high), 0.5), forwardOf(camera), -radius / Math.sin(half));
  return cameraOf(turnOf(camera), eye, camera.yfov);
}

/** Between two cameras; `share` 0 is the first.
 * @param {Camera} from @param {Camera} to @param {number} share */
export const cameraBetween = (from, to, share) =>
  cameraOf(
    rotationBetween(turnOf(from), turnOf(to), share),
    mixed(eyeOf(from), eyeOf(to), share),
    from.yfov + (to.yfov - from.yfov) * share,
  );
