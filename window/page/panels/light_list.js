/**
 * The list of lights, with what adds, copies and removes them.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/edits.js").Edits} Edits
 * @typedef {import("../stage/camera_moves.js").CameraMoves} CameraMoves
 * @typedef {import("../types.js").LightType} LightType
 */
import { byId, element, icon, setAttribute, setText } from "../controls/elements.js";
import { sidesOf, eyeOf } from "../maths/camera.js";
import { LIGHT_NAMES, colourOf, newLight } from "../maths/light_values.js";
import { distance, moved } from "../maths/vectors.js";

/** How far a copy stands from its light, in diagonals. A choice. */
const COPY_STEP = 0.04;

export class LightList {
  #select = NaN;

  /** @param {Model} model @param {Edits} edits @param {CameraMoves} moves */
  constructor(model, edits, moves) {
    this.model = model;
    this.edits = edits;
    this.moves = moves;
    this.list = byId("light-list", HTMLElement);
    for (const type of /** @type {LightType[]} */ (["spot", "point", "directional"])) {
      byId(`add-${type}`, HTMLElement).addEventListener("click", () => this.add(type));
    }
    byId("duplicate-light", HTMLElement).addEventListener("click", () => this.duplicate());
    byId("remove-light", HTMLElement).addEventListener("click", () => this.remove());
    this.list.addEventListener("keydown", (event) => this.#key(event));
    model.on(["state", "selection", "scene"], () => this.#update());
  }

  /** @param {number} index -1 selects none */
  select(index) {
    this.model.selected = index;
    this.model.changed("selection");
  }

  /** @param {LightType} type */
  add(type) {
    const { camera, pivotOrMiddle } = this.moves;
    this.#addLight(newLight(type, camera, distance(eyeOf(camera), pivotOrMiddle)));
  }

  duplicate() {
    const light = this.model.lights[this.model.selected];
    if (!light) return;
    const [right] = sidesOf(this.moves.camera);
    this.#addLight({ ...light, position: moved(light.position, right, COPY_STEP * this.model.diagonal) });
  }

  remove() {
    const { selected, lights } = this.model;
    if (!lights[selected]) return;
    this.edits.removeLight(selected);
    this.select(Math.min(selected, lights.length - 2));
  }

  /** @param {import("../types.js").Light} light */
  #addLight(light) {
    // The new light is the last of those that the server then tells of.
    this.#select = this.model.lights.length;
    this.edits.addLight(light);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const to = Math.max(0, Math.min(this.model.lights.length - 1, this.model.selected + step));
    this.select(to);
    /** @type {HTMLElement | undefined} */ (this.list.children[to])?.focus();
  }

  #update() {
    const { model, list } = this;
    const { lights } = model;
    if (lights.length > this.#select) {
      model.selected = this.#select;
      this.#select = NaN;
      model.changed("selection");
    }
    if (model.selected >= lights.length) model.selected = -1;
    while (list.children.length > lights.length) list.lastElementChild?.remove();
    while (list.children.length < lights.length) {
      const index = list.children.length;
      const row = element("button", { type: "button", role: "option", class: "light", "data-light": index });
      row.append(icon("spot"), element("span", { class: "name" }), element("span", { class: "swatch" }));
      row.addEventListener("click", () => this.select(index));
      list.append(row);
    }
    const counts = new Map();
    lights.forEach((light, index) => {
      const row = /** @type {HTMLElement} */ (list.children[index]);
      const count = (counts.get(light.type) ?? 0) + 1;
      counts.set(light.type, count);
      setAttribute(/** @type {Element} */ (row.querySelector("use")), "href", `#icon-${light.type}`);
      setText(
        /** @type {Element} */ (row.querySelector(".name")),
        light.name || `${LIGHT_NAMES[light.type]} ${count}`,
      );
      row.title = light.name ?? "";
      /** @type {HTMLElement} */ (row.querySelector(".swatch")).style.setProperty(
        "--light",
        colourOf(light.intensity).hex,
      );
      setAttribute(row, "aria-selected", String(index === model.selected));
      // One stop of the Tab key for the whole list.
      row.tabIndex = index === Math.max(0, model.selected) ? 0 : -1;
    });
    byId("no-lights", HTMLElement).hidden = lights.length > 0 || !model.state;
    for (const id of ["duplicate-light", "remove-light", "move-light"])
      byId(id, HTMLButtonElement).disabled = model.selected < 0;
  }
}
