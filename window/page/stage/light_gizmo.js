/**
 * The handles of the selected light: arrows and disc that move it, a direction that turns it, cones.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../types.js").Vector} Vector
 * @typedef {import("../types.js").Light} Light
 * @typedef {"x" | "y" | "z" | "move" | "direction" | "outer_cone" | "inner_cone"} Handle
 */
import { byId, setAttribute, shape } from "../controls/elements.js";
import { projected, projectedSegment, unitsOfPixel } from "../maths/projection.js";
import { acrossOf, add, moved, scaled } from "../maths/vectors.js";
import { placedLight } from "./light_places.js";

/** Lengths in pixels on the screen: arrows, direction, cones. */
const ARROW = 84;
export const DIRECTION_LENGTH = 112;
export const CONE_LENGTH = 150;
/** Points of a circle. */
const CIRCLE_POINTS = 48;

/** @type {Record<"x" | "y" | "z", Vector>} */
export const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };

/** A circle about `axis` at `angle` from it, on a sphere about `apex`.
 * @param {Vector} apex @param {Vector} axis @param {number} angle
 * @param {number} radius @returns {Vector[]} */
export function coneCircle(apex, axis, angle, radius) {
  const [first, second] = acrossOf(axis);
  const centre = moved(apex, axis, Math.cos(angle) * radius);
  return Array.from({ length: CIRCLE_POINTS }, (_, index) => {
    const turn = (2 * Math.PI * index) / CIRCLE_POINTS;
    const across = add(scaled(first, Math.cos(turn)), scaled(second, Math.sin(turn)));
    return moved(centre, across, Math.sin(angle) * radius);
  });
}

export class LightGizmo {
  /** While a handle is dragged, none is hidden: a hidden element would lose the pointer. */ dragging = false;

  /** @param {Model} model @param {(handle: Handle, event: PointerEvent) => void} press */
  constructor(model, press) {
    this.model = model;
    this.stage = byId("stage", HTMLElement);
    this.root = byId("gizmo", SVGElement);
    const handles = /** @type {Handle[]} */ ([
      "inner_cone",
      "outer_cone",
      "x",
      "y",
      "z",
      "direction",
      "move",
    ]);
    /** @type {Record<string, {group: SVGElement, hit: SVGElement, line: SVGElement, tip: SVGElement}>} */
    this.parts = {};
    this.edges = shape("path", { class: "edges" });
    this.root.append(this.edges);
    for (const handle of handles) {
      const [hit, line, tip] = [
        shape("path", { class: "hit" }),
        shape("path", { class: "line" }),
        shape("path", { class: "tip" }),
      ];
      const group = shape("g", { class: `handle ${handle}`, "data-handle": handle }, hit, line, tip);
      group.addEventListener("pointerdown", (event) => press(handle, /** @type {PointerEvent} */ (event)));
      this.parts[handle] = { group, hit, line, tip };
      this.root.append(group);
    }
    model.on(["viewing", "image", "state", "selection", "scene"], () => this.draw());
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.stage;
    const { model } = this;
    const placed = placedLight(model, model.selected, width / height);
    const seen = placed && projected(model.seenCamera, width / height, placed.anchor);
    setAttribute(this.root, "visibility", seen ? null : "hidden");
    if (!placed || !seen) return;
    const { light, anchor, posed } = placed;
    this.root.classList.toggle("posed", posed);
    const unit = unitsOfPixel(model.seenCamera, height, seen.depth);
    const at = (/** @type {Vector} */ point) => {
      const there = projected(model.seenCamera, width / height, point);
      return there && [there.place[0] * width, there.place[1] * height];
    };
    const line = (/** @type {Vector} */ from, /** @type {Vector} */ to) => {
      const ends = projectedSegment(model.seenCamera, width / height, from, to);
      return ends ? ends.map(([x, y]) => [x * width, y * height]) : [];
    };
    const free = light.type !== "directional";
    for (const [name, axis] of Object.entries(AXES)) {
      this.#arrow(name, free ? line(anchor, moved(anchor, axis, ARROW * unit)) : []);
    }
    const centre = /** @type {number[]} */ (at(anchor));
    this.#set("move", free ? ring(centre, 15) : "", "", ring(centre, 15));
    const tip =
      light.type === "point" ? [] : line(anchor, moved(anchor, light.direction, DIRECTION_LENGTH * unit));
    this.#set("direction", path(tip), path(tip), tip.length ? ring(tip[1], 6) : "");
    let edges = "";
    for (const name of /** @type {const} */ (["inner_cone", "outer_cone"])) {
      const circle =
        light.type === "spot" ? coneCircle(anchor, light.direction, light[name], CONE_LENGTH * unit) : [];
      const outline = circle
        .map((point, index) => path(line(point, circle[(index + 1) % circle.length])))
        .join("");
      this.#set(name, outline, outline, "");
      if (name !== "outer_cone") continue;
      for (let quarter = 0; quarter < circle.length; quarter += CIRCLE_POINTS / 4)
        edges += path(line(anchor, circle[quarter]));
    }
    setAttribute(this.edges, "d", edges);
  }

  /** @param {string} name @param {number[][]} ends */
  #arrow(name, ends) {
    if (!ends.length) {
      this.#set(name, "", "", "");
      return;
    }
    const [[x0, y0], [x1, y1]] = ends;
    const size = Math.hypot(x1 - x0, y1 - y0);
    // Seen from its end, an arrow is a dot.
    const [ux, uy] = size > 1 ? [(x1 - x0) / size, (y1 - y0) / size] : [0, -1];
    const head = Math.min(13, size * 0.7);
    const [bx, by] = [x1 - ux * head, y1 - uy * head];
    const width = 4.5;
    const tip = `${path([
      [x1, y1],
      [bx - uy * width, by + ux * width],
      [bx + uy * width, by - ux * width],
    ])}Z`;
    // The first pixels belong to the disc in the middle.
    const begin = Math.min(18, size * 0.5);
    const shaft = path([
      [x0 + ux * begin, y0 + uy * begin],
      [x1, y1],
    ]);
    this.#set(name, shaft, shaft, tip);
  }

  /** @param {string} name @param {string} hit @param {string} line @param {string} tip */
  #set(name, hit, line, tip) {
    const part = this.parts[name];
    setAttribute(part.group, "visibility", hit || this.dragging ? null : "hidden");
    setAttribute(part.hit, "d", hit);
    setAttribute(part.line, "d", line);
    setAttribute(part.tip, "d", tip);
  }
}

/** @param {number} x @param {number} y */
const pair = (x, y) => `${x.toFixed(1)} ${y.toFixed(1)}`;

/** @param {number[][]} points */
const path = (points) => points.map(([x, y], index) => `${index ? "L" : "M"}${pair(x, y)}`).join("");

/** @param {number[]} centre @param {number} radius */
const ring = ([x, y], radius) =>
  `M${pair(x - radius, y)}` +
  `a${radius} ${radius} 0 1 0 ${2 * radius} 0a${radius} ${radius} 0 1 0 ${-2 * radius} 0Z`;
