/**
 * Lights as people set them: colour and strength, azimuth and elevation, and new lights.
 *
 * @typedef {import("../types.js").Vector} Vector
 * @typedef {import("../types.js").Camera} Camera
 * @typedef {import("../types.js").Light} Light
 * @typedef {import("../types.js").LightType} LightType
 */
import { eyeOf, forwardOf } from "./camera.js";
import { moved } from "./vectors.js";

/** Irradiance of a new light at its target, W/m². A choice: white paper is then near white in the image. */
const NEW_IRRADIANCE = 3;
/** Half angles of a new spot: 20° and 30°. A choice. */
const NEW_INNER = Math.PI / 9;
const NEW_OUTER = Math.PI / 6;

/** What lights are called. @type {Record<LightType, string>} */
export const LIGHT_NAMES = { spot: "Spot", point: "Point", directional: "Sun" };

/** A linear value in [0, 1] encoded for sRGB (IEC 61966-2-1). @param {number} value */
export const encoded = (value) => (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);

/** The inverse of `encoded`. @param {number} value */
export const decoded = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);

/** An intensity as a strength, its largest component, and an sRGB colour `#rrggbb` whose largest is 255.
 * @param {Vector} intensity */
export function colourOf(intensity) {
  const strength = Math.max(...intensity);
  const hex = intensity.map((value) => {
    const byte = Math.round(255 * encoded(strength > 0 ? value / strength : 1));
    return byte.toString(16).padStart(2, "0");
  });
  return { hex: `#${hex.join("")}`, strength };
}

/** The intensity of an sRGB colour and a strength; black counts as white, as it has no hue.
 * @param {string} hex `#rrggbb` @param {number} strength @returns {Vector} */
export function intensityOf(hex, strength) {
  const linear = [1, 3, 5].map((at) => decoded(parseInt(hex.slice(at, at + 2), 16) / 255));
  const largest = Math.max(...linear);
  return /** @type {Vector} */ (linear.map((value) => (largest > 0 ? value / largest : 1) * strength));
}

/** Degrees: azimuth 0 is −Z and grows towards +X, elevation is upwards.
 * @param {Vector} direction of unit length */
export function degreesOf([x, y, z]) {
  const level = Math.hypot(x, z);
  return {
    azimuth: level < 1e-9 ? 0 : (Math.atan2(x, -z) * 180) / Math.PI,
    elevation: (Math.atan2(y, level) * 180) / Math.PI,
  };
}

/** The inverse of `degreesOf`. @param {number} azimuth @param {number} elevation @returns {Vector} */
export function directionOf(azimuth, elevation) {
  const [a, e] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
  return [Math.cos(e) * Math.sin(a), Math.sin(e), -Math.cos(e) * Math.cos(a)];
}

/** A new light for what the camera sees: a spot at the eye that looks along it, a point half way to `reach`,
 * or a sun from behind the left shoulder. White.
 * @param {LightType} type @param {Camera} camera
 * @param {number} reach distance of what the light is meant for, world units @returns {Light} */
export function newLight(type, camera, reach) {
  const lit = type === "point" ? reach / 2 : reach;
  const strength = type === "directional" ? NEW_IRRADIANCE : NEW_IRRADIANCE * lit * lit;
  const { azimuth } = degreesOf(forwardOf(camera));
  return {
    type,
    position: type === "point" ? moved(eyeOf(camera), forwardOf(camera), lit) : eyeOf(camera),
    direction: type === "directional" ? directionOf(azimuth + 40, -50) : forwardOf(camera),
    intensity: [strength, strength, strength],
    inner_cone: NEW_INNER,
    outer_cone: NEW_OUTER,
  };
}
