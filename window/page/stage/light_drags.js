/**
 * Dragging the handles of a light, and putting it on a surface. Each drag is one gesture.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/edits.js").Edits} Edits
 * @typedef {import("./light_gizmo.js").Handle} Handle
 * @typedef {import("../types.js").Light} Light
 * @typedef {import("../types.js").Picked} Picked
 * @typedef {import("../types.js").Vector} Vector
 * @typedef {import("../maths/projection.js").Ray} Ray
 */
import { byId } from "../controls/elements.js";
import { forwardOf } from "../maths/camera.js";
import { DirectionDrag, allowedCones, coneThrough, nearestOnAxis, onPlane } from "../maths/gizmo_drags.js";
import { projected, rayThrough, unitsOfPixel } from "../maths/projection.js";
import { add, moved, subtract } from "../maths/vectors.js";
import { AXES, CONE_LENGTH, DIRECTION_LENGTH, LightGizmo } from "./light_gizmo.js";
import { placedLight } from "./light_places.js";

/** How far off a surface a light is put, in diagonals: it must not be shaded by that surface. A choice. */
const OFF_SURFACE = 0.01;

export class LightDrags {
  /** @param {Model} model @param {Edits} edits */
  constructor(model, edits) {
    this.model = model;
    this.edits = edits;
    this.stage = byId("stage", HTMLElement);
    this.gizmo = new LightGizmo(model, (handle, event) => this.#press(handle, event));
  }

  /** @param {PointerEvent} event @returns {Ray} */
  #ray(event) {
    const box = this.stage.getBoundingClientRect();
    return rayThrough(this.model.seenCamera, box.width / box.height, [
      (event.clientX - box.left) / box.width,
      (event.clientY - box.top) / box.height,
    ]);
  }

  /** @param {Handle} handle @param {PointerEvent} down */
  #press(handle, down) {
    const { model, edits, gizmo } = this;
    const index = model.selected;
    const { width, height } = this.stage.getBoundingClientRect();
    const placed = placedLight(model, index, width / height);
    const seen = placed && projected(model.seenCamera, width / height, placed.anchor);
    if (down.button !== 0 || !placed || !seen || placed.posed) return;
    down.stopPropagation();
    this.stage.focus({ preventScroll: true });
    const group = gizmo.parts[handle].group;
    const begin = model.lights[index];
    const unit = unitsOfPixel(model.seenCamera, height, seen.depth);
    const change = dragOf(handle, begin, placed.anchor, this.#ray(down), unit, forwardOf(model.seenCamera));
    const gesture = edits.gesture();
    let latest = begin;
    const move = (/** @type {PointerEvent} */ event) => {
      latest = { ...latest, ...change(this.#ray(event)) };
      edits.light(gesture, index, latest);
    };
    const escape = (/** @type {KeyboardEvent} */ event) => {
      if (event.key !== "Escape") return;
      event.stopPropagation();
      group.removeEventListener("pointermove", /** @type {any} */ (move));
      edits.light(gesture, index, begin);
    };
    gizmo.dragging = true;
    group.classList.add("held");
    group.setPointerCapture(down.pointerId);
    group.addEventListener("pointermove", /** @type {any} */ (move));
    window.addEventListener("keydown", escape, true);
    group.addEventListener(
      "lostpointercapture",
      () => {
        group.removeEventListener("pointermove", /** @type {any} */ (move));
        window.removeEventListener("keydown", escape, true);
        group.classList.remove("held");
        gizmo.dragging = false;
        edits.end();
        gizmo.draw();
      },
      { once: true },
    );
  }

  /** Moves the selected light just off a surface. @param {Picked} picked */
  putOn(picked) {
    const light = this.model.lights[this.model.selected];
    if (!light || !picked.position) return;
    const position = moved(picked.position, picked.normal, OFF_SURFACE * this.model.diagonal);
    this.edits.light(this.edits.gesture(), this.model.selected, { ...light, position });
    this.edits.end();
  }
}

/** What a drag of a handle changes: from the ray of the pointer to members of the light.
 * @param {Handle} handle @param {Light} begin @param {Vector} anchor @param {Ray} start @param {number} unit
 * @param {Vector} forward @returns {(ray: Ray) => Partial<Light>} */
function dragOf(handle, begin, anchor, start, unit, forward) {
  if (handle === "x" || handle === "y" || handle === "z") {
    const axis = AXES[handle];
    const from = nearestOnAxis(start, anchor, axis) ?? 0;
    return (ray) => {
      const to = nearestOnAxis(ray, anchor, axis);
      return to === null ? {} : { position: moved(begin.position, axis, to - from) };
    };
  }
  if (handle === "move") {
    const from = onPlane(start, anchor, forward) ?? anchor;
    return (ray) => {
      const to = onPlane(ray, anchor, forward);
      return to ? { position: add(begin.position, subtract(to, from)) } : {};
    };
  }
  if (handle === "direction") {
    const drag = new DirectionDrag(start, anchor, DIRECTION_LENGTH * unit, begin.direction);
    return (ray) => ({ direction: drag.moved(ray) });
  }
  let current = begin[handle];
  return (ray) => {
    current = coneThrough(ray, anchor, CONE_LENGTH * unit, begin.direction, current);
    return allowedCones(
      handle === "inner_cone" ? current : begin.inner_cone,
      handle === "outer_cone" ? current : begin.outer_cone,
      handle,
    );
  };
}
