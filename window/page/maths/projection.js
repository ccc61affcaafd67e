/**
 * From world to image and back. Places in the image are in [0, 1]², from the top left.
 *
 * @typedef {import("../types.js").Vector} Vector
 * @typedef {import("../types.js").Camera} Camera
 * @typedef {[number, number]} Place
 * @typedef {{origin: Vector, direction: Vector}} Ray  the direction has unit length
 */
import { eyeOf, turnOf } from "./camera.js";
import { mixed, normalized, rotated, subtract, unrotated } from "./vectors.js";

/** Depth in front of the eye below which nothing is projected, as a share of the distances compared. */
const NEAR_SHARE = 1e-4;

/** A world point in the camera's axes; z is negative in front.
 * @param {Camera} camera @param {Vector} point */
export const inCamera = (camera, point) => unrotated(turnOf(camera), subtract(point, eyeOf(camera)));

/** Where a point lies in the image, and its depth along the view axis; null behind the eye.
 * @param {Camera} camera @param {number} aspect @param {Vector} point
 * @returns {{place: Place, depth: number} | null} */
export function projected(camera, aspect, point) {
  const [x, y, z] = inCamera(camera, point);
  if (!(-z > 0)) return null;
  const height = -z * Math.tan(camera.yfov / 2);
  return { place: [0.5 + x / (2 * height * aspect), 0.5 - y / (2 * height)], depth: -z };
}

/** The ray through a place of the image.
 * @param {Camera} camera @param {number} aspect @param {Place} place @returns {Ray} */
export function rayThrough(camera, aspect, [x, y]) {
  const half = Math.tan(camera.yfov / 2);
  const direction = normalized([(2 * x - 1) * half * aspect, (1 - 2 * y) * half, -1]);
  return { origin: eyeOf(camera), direction: rotated(turnOf(camera), direction) };
}

/** World units that a pixel covers at a depth. @param {Camera} camera @param {number} height pixels
 * @param {number} depth */
export const unitsOfPixel = (camera, height, depth) => (2 * depth * Math.tan(camera.yfov / 2)) / height;

/** The part of a segment in front of the eye, as two places; null where all of it lies behind.
 * @param {Camera} camera @param {number} aspect @param {Vector} from @param {Vector} to
 * @returns {[Place, Place] | null} */
export function projectedSegment(camera, aspect, from, to) {
  const [z0, z1] = [-inCamera(camera, from)[2], -inCamera(camera, to)[2]];
  const near = NEAR_SHARE * Math.max(Math.abs(z0), Math.abs(z1));
  if (z0 < near && z1 < near) return null;
  const start = z0 < near ? mixed(from, to, (near - z0) / (z1 - z0)) : from;
  const end = z1 < near ? mixed(to, from, (near - z1) / (z0 - z1)) : to;
  const [first, last] = [projected(camera, aspect, start), projected(camera, aspect, end)];
  return first && last && [first.place, last.place];
}
