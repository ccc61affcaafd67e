/**
 * What a pointer's ray means while a handle of a light is dragged.
 *
 * @typedef {import("../types.js").Vector} Vector
 * @typedef {import("./projection.js").Ray} Ray
 */
import { dot, moved, normalized, scaled, subtract } from "./vectors.js";

/** Sine² of the angle of ray and axis below which their nearest points are too uncertain to follow: 3°. */
const PARALLEL = 0.003;
/** Least angle of an outer cone: half a degree. A choice, so that the handle can still be caught. */
export const NARROWEST_CONE = Math.PI / 360;

/** How far along the line `point` + s · `axis` (unit) it comes nearest to the ray; null where they are
 * nearly parallel. @param {Ray} ray @param {Vector} point @param {Vector} axis */
export function nearestOnAxis(ray, point, axis) {
  const between = subtract(ray.origin, point);
  const cosine = dot(axis, ray.direction);
  const sine2 = 1 - cosine * cosine;
  if (sine2 < PARALLEL) return null;
  return (dot(axis, between) - cosine * dot(ray.direction, between)) / sine2;
}

/** Where the ray meets a plane; null where it does not, or behind the eye.
 * @param {Ray} ray @param {Vector} point @param {Vector} normal @returns {Vector | null} */
export function onPlane(ray, point, normal) {
  const slope = dot(ray.direction, normal);
  if (Math.abs(slope) < 1e-6) return null;
  const reach = dot(subtract(point, ray.origin), normal) / slope;
  return reach > 0 ? moved(ray.origin, ray.direction, reach) : null;
}

/** The unit vectors from `centre` to where the ray enters and leaves a sphere. Where it misses, both are the
 * point of the rim that it passes nearest to.
 * @param {Ray} ray @param {Vector} centre @param {number} radius
 * @returns {{near: Vector, far: Vector, missed: boolean}} */
export function onSphere(ray, centre, radius) {
  const between = subtract(ray.origin, centre);
  const middle = dot(between, ray.direction);
  const square = middle * middle - dot(between, between) + radius * radius;
  const foot = moved(between, ray.direction, -middle);
  if (square < 0) {
    const rim = normalized(foot);
    return { near: rim, far: rim, missed: true };
  }
  const half = Math.sqrt(square);
  return {
    near: normalized(scaled(moved(foot, ray.direction, -half), 1 / radius)),
    far: normalized(scaled(moved(foot, ray.direction, half), 1 / radius)),
    missed: false,
  };
}

/** A drag of a direction over the sphere about the light. It stays on the side, near or far, where it began;
 * leaving the sphere's outline and coming back changes the side.
 */
export class DirectionDrag {
  /** @param {Ray} ray of the start @param {Vector} centre @param {number} radius @param {Vector} direction */
  constructor(ray, centre, radius, direction) {
    this.centre = centre;
    this.radius = radius;
    this.side = dot(direction, ray.direction) > 0 ? "far" : "near";
    this.outside = false;
  }

  /** @param {Ray} ray @returns {Vector} the new direction, of unit length */
  moved(ray) {
    const hit = onSphere(ray, this.centre, this.radius);
    if (this.outside && !hit.missed) this.side = this.side === "far" ? "near" : "far";
    this.outside = hit.missed;
    return this.side === "far" ? hit.far : hit.near;
  }
}

/** The half angle of the cone about `axis` that passes through the ray, on the sphere of `radius` about the
 * apex: of the two there are, the one nearer to `current`. Radians, at most π/2.
 * @param {Ray} ray @param {Vector} apex @param {number} radius
 * @param {Vector} axis @param {number} current */
export function coneThrough(ray, apex, radius, axis, current) {
  const hit = onSphere(ray, apex, radius);
  const [near, far] = [hit.near, hit.far].map((to) => Math.acos(Math.max(-1, Math.min(1, dot(to, axis)))));
  const angle = Math.abs(near - current) <= Math.abs(far - current) ? near : far;
  return Math.min(Math.PI / 2, angle);
}

/** A spot's half angles after one of them was set: 0 ≤ inner ≤ outer, and the one that was set wins.
 * @param {number} inner @param {number} outer @param {"inner_cone" | "outer_cone"} set */
export function allowedCones(inner, outer, set) {
  const clamp = (/** @type {number} */ angle, /** @type {number} */ low) =>
    Math.max(low, Math.min(Math.PI / 2, angle));
  if (set === "inner_cone") {
    const to = clamp(inner, 0);
    return { inner_cone: to, outer_cone: Math.max(to, outer) };
  }
  const to = clamp(outer, NARROWEST_CONE);
  return { inner_cone: Math.min(inner, to), outer_cone: to };
}
