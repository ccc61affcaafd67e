/**
 * Where a light is drawn over the stage.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../types.js").Light} Light
 * @typedef {import("../types.js").Vector} Vector
 */
import { rayThrough } from "../maths/projection.js";
import { distance, moved } from "../maths/vectors.js";

/** Height in the image at which suns are drawn, and the step between two. */
const SUN_HEIGHT = 0.2;
const SUN_STEP = 0.09;
/** Difference below which a posed light is where the document has it: rounding of single precision. */
const SAME = 1e-5;

/** A light as it is drawn: where the animation has it, else as edited. `anchor` is its place in the world; a
 * sun has none and stands at a fixed place of the image.
 * @param {Model} model @param {number} index @param {number} aspect
 * @returns {{light: Light, anchor: Vector, posed: boolean} | null} */
export function placedLight(model, index, aspect) {
  const light = model.lights[index];
  if (!light) return null;
  const other = model.posedLights?.[index];
  const posed =
    model.viewing.seconds !== null &&
    !model.pending.has(`light ${index}`) &&
    other !== undefined &&
    other.type === light.type &&
    (distance(other.position, light.position) > SAME * model.diagonal ||
      distance(other.direction, light.direction) > SAME);
  const drawn = posed ? /** @type {Light} */ (other) : light;
  if (drawn.type !== "directional") return { light: drawn, anchor: drawn.position, posed };
  const suns = model.lights
    .map((each, at) => (each.type === "directional" ? at : -1))
    .filter((at) => at >= 0);
  const x = 0.5 + (suns.indexOf(index) - (suns.length - 1) / 2) * SUN_STEP;
  const ray = rayThrough(model.seenCamera, aspect, [x, SUN_HEIGHT]);
  return { light: drawn, anchor: moved(ray.origin, ray.direction, model.diagonal), posed };
}
