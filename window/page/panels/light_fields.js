/**
 * The numbers of the selected light: colour and strength, place, direction, cone.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/edits.js").Edits} Edits
 * @typedef {import("../types.js").Light} Light
 * @typedef {import("../types.js").Vector} Vector
 */
import { byId, element, setText } from "../controls/elements.js";
import { NumberField } from "../controls/number_field.js";
import { allowedCones } from "../maths/gizmo_drags.js";
import { colourOf, degreesOf, directionOf, intensityOf } from "../maths/light_values.js";
import { formatted } from "../maths/scales.js";

/** Step of a place, in diagonals; with shift a tenth, as everywhere below. */
const PLACE_STEP = 1 / 400;
/** Degrees of a step. */
const ANGLE_STEP = 1;
/** What a step multiplies a strength by, and the strength that a step from nothing gives. */
const STRENGTH_STEP = 1.05;
const LEAST_STRENGTH = 0.01;
const FINE = 0.1;
const DEGREES = 180 / Math.PI;

/** @param {number} value */
const angleText = (value) => formatted(Math.abs(value) < 5e-4 ? 0 : value);

export class LightFields {
  /** Colour that the user chose: a light that is off has none of its own. */ #hex = "#ffffff";
  #colourGesture = 0;

  /** @param {Model} model @param {Edits} edits */
  constructor(model, edits) {
    this.model = model;
    this.edits = edits;
    this.root = byId("light-fields", HTMLElement);
    const unit = element("span", { class: "unit" });
    this.unit = unit;
    this.colour = element("input", {
      type: "color",
      "aria-label": "colour of the light",
      "data-field": "colour",
    });
    this.strength = this.#number(
      "strength",
      "strength",
      (light, value) => ({ intensity: intensityOf(this.#hex, Math.max(0, value)) }),
      (value, steps, fine) =>
        Math.max(value, steps > 0 ? LEAST_STRENGTH : 0) * STRENGTH_STEP ** (steps * (fine ? FINE : 1)),
    );
    this.places = ["x", "y", "z"].map((axis, at) =>
      this.#number(
        axis,
        `position ${axis}`,
        (light, value) => {
          const position = /** @type {Vector} */ ([...light.position]);
          position[at] = value;
          return { position };
        },
        (value, steps, fine) => value + steps * PLACE_STEP * this.model.diagonal * (fine ? FINE : 1),
      ),
    );
    const turn = (/** @type {number} */ value, /** @type {number} */ steps, /** @type {boolean} */ fine) =>
      value + steps * ANGLE_STEP * (fine ? FINE : 1);
    this.azimuth = this.#number(
      "azimuth",
      "azimuth in degrees",
      (light, value) => ({ direction: directionOf(value, degreesOf(light.direction).elevation) }),
      turn,
      angleText,
    );
    this.elevation = this.#number(
      "elevation",
      "elevation in degrees",
      (light, value) => ({
        // Short of straight up and down, where the azimuth would be lost.
        direction: directionOf(degreesOf(light.direction).azimuth, Math.max(-89.99, Math.min(89.99, value))),
      }),
      turn,
      angleText,
    );
    this.cones = /** @type {const} */ (["inner_cone", "outer_cone"]).map((member) =>
      this.#number(
        member,
        `${member.slice(0, 5)} half angle in degrees`,
        (light, value) =>
          allowedCones(
            member === "inner_cone" ? value / DEGREES : light.inner_cone,
            member === "outer_cone" ? value / DEGREES : light.outer_cone,
            member,
          ),
        turn,
        angleText,
      ),
    );
    this.colour.addEventListener("input", () => {
      this.#colourGesture ||= edits.gesture();
      this.#hex = this.colour.value;
      this.#change(this.#colourGesture, ({ intensity }) => ({
        intensity: intensityOf(this.#hex, Math.max(...intensity)),
      }));
    });
    this.colour.addEventListener("change", () => {
      this.#colourGesture = 0;
      edits.end();
    });
    this.rows = {
      strength: this.#row("strength", [this.colour, this.strength.input, unit], this.strength),
      position: this.#row(
        "position",
        this.places.map((field) => field.input),
      ),
      direction: this.#row("direction", [
        this.azimuth.input,
        this.elevation.input,
        element("span", { class: "unit" }, "az., el. °"),
      ]),
      cone: this.#row("cone", [
        ...this.cones.map((field) => field.input),
        element("span", { class: "unit" }, "in, out °"),
      ]),
    };
    model.on(["state", "selection", "viewing"], () => this.#update());
  }

  /** @param {string} id @param {string} label @param {(light: Light, value: number) => Partial<Light>} change
   * @param {(value: number, steps: number, fine: boolean) => number} step
   * @param {(value: number) => string} [format] */
  #number(id, label, change, step, format) {
    return new NumberField(
      label,
      {
        begin: () => this.edits.gesture(),
        set: (value, gesture) => this.#change(gesture, (light) => change(light, value)),
        end: () => this.edits.end(),
        step,
        format,
      },
      { "data-field": id },
    );
  }

  /** @param {string} name @param {HTMLElement[]} inputs @param {NumberField} [dragged] */
  #row(name, inputs, dragged) {
    const label = element("span", { class: "name" }, name);
    dragged?.draggedBy(label);
    const row = element(
      "div",
      { class: "row light-row", role: "group", "aria-label": name },
      label,
      element("span", { class: "inputs" }, ...inputs),
    );
    this.root.append(row);
    return row;
  }

  /** @param {number} gesture @param {(light: Light) => Partial<Light>} change */
  #change(gesture, change) {
    const { selected, lights } = this.model;
    const light = lights[selected];
    if (light) this.edits.light(gesture, selected, { ...light, ...change(light) });
  }

  #update() {
    const { model } = this;
    const light = model.lights[model.selected];
    this.root.hidden = !light;
    if (!light) return;
    const { hex, strength } = colourOf(light.intensity);
    if (strength > 0) this.#hex = hex;
    if (!this.#colourGesture) this.colour.value = this.#hex;
    this.strength.show(strength);
    setText(this.unit, light.type === "directional" ? "W/m²" : "W/sr");
    this.rows.position.hidden = light.type === "directional";
    this.rows.direction.hidden = light.type === "point";
    this.rows.cone.hidden = light.type !== "spot";
    this.places.forEach((field, at) => field.show(light.position[at]));
    const { azimuth, elevation } = degreesOf(light.direction);
    this.azimuth.show(azimuth);
    this.elevation.show(elevation);
    this.cones[0].show(light.inner_cone * DEGREES);
    this.cones[1].show(light.outer_cone * DEGREES);
    byId("posed-note", HTMLElement).hidden = model.viewing.seconds === null;
  }
}
