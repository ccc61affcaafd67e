/**
 * A row for each parameter: symbol, name, slider, value, reset.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/edits.js").Edits} Edits
 * @typedef {import("../types.js").Parameter} Parameter
 */
import { byId, element, iconButton, setText } from "../controls/elements.js";
import { NumberField } from "../controls/number_field.js";
import { Slider } from "../controls/slider.js";
import { allowed, formatted, stepped } from "../maths/scales.js";
import { humanised } from "../maths/words.js";
import { CONFIG_SOURCES, SOURCE_NAMES } from "../types.js";

/** Units that say nothing beside a number. */
const PLAIN_UNITS = ["", "1"];

class ParameterRow {
  /** @param {Parameter} spec @param {Model} model @param {Edits} edits */
  constructor(spec, model, edits) {
    this.spec = spec;
    this.model = model;
    this.edits = edits;
    this.range = { low: spec.low, high: spec.high, scale: spec.scale, whole: spec.whole_number };
    const name = humanised(spec.name);
    const use = {
      begin: () => edits.gesture(),
      set: (/** @type {number} */ value, /** @type {number} */ gesture) => this.#set(value, gesture),
      end: () => edits.end(),
    };
    const unit = PLAIN_UNITS.includes(spec.unit) ? "" : spec.unit;
    this.slider = new Slider(this.range, name, use);
    this.number = new NumberField(`${name}, value`, {
      ...use,
      step: (value, steps, fine) => stepped(this.range, value, steps, fine),
    });
    this.reset = iconButton("reset", `Reset ${name} to ${formatted(spec.default)}`, {
      "data-reset": spec.name,
    });
    this.reset.addEventListener("click", () => this.#reset(edits.gesture()));
    const label = element("span", { class: "name" }, name, element("small", {}, unit));
    const meaning = element("span", { class: "for-readers", id: `meaning-${spec.name}` }, spec.meaning);
    const bounds = `${formatted(spec.low)} … ${formatted(spec.high)} ${unit}`.trim();
    label.title = `${spec.meaning}\n${bounds}, default ${formatted(spec.default)}`;
    for (const input of [this.slider.input, this.number.input])
      input.setAttribute("aria-describedby", meaning.id);
    this.number.draggedBy(label);
    // A double-click is one step of undo with the first press, which moved the slider.
    this.slider.input.addEventListener("dblclick", () => this.#reset(this.slider.gesture));
    label.addEventListener("dblclick", () => this.#reset(edits.gesture()));
    this.root = element(
      "div",
      { class: "row parameter", role: "group", "aria-label": name, "data-parameter": spec.name },
      element("span", { class: "symbol", "aria-hidden": true }, spec.symbol),
      label,
      meaning,
      this.slider.root,
      this.number.input,
      this.reset,
    );
    this.slider.mark("default", spec.default);
  }

  update() {
    const { spec, model } = this;
    const { configs, fit } = model.state ?? {};
    const source = model.edited;
    const kept = configs?.[source] ?? configs?.hand;
    const header = model.shown.a?.header;
    const prior = header?.source === source ? header.parameters?.[spec.name] : undefined;
    const own =
      source === "hand"
        ? model.current(`parameter ${spec.name}`, prior ?? kept?.parameters[spec.name])
        : (prior ?? kept?.parameters[spec.name]);
    const value = own ?? spec.default;
    this.slider.show(value, `${formatted(value)} ${PLAIN_UNITS.includes(spec.unit) ? "" : spec.unit}`.trim());
    this.number.show(value);
    const fixed = source === "auto" && prior !== undefined;
    this.slider.input.disabled = fixed;
    this.number.enable(!fixed, fixed ? "set by the prior in every frame" : "");
    this.root.classList.toggle("fixed", fixed);
    this.root.classList.toggle("changed", value !== spec.default);
    this.reset.disabled = fixed || value === spec.default;
    this.slider.mark("tuned", configs?.tuned?.parameters[spec.name]);
    this.slider.band(spec.fitted ? configs?.tuned?.intervals?.[spec.name] : null);
    this.slider.mark("ghost", fit?.running ? fit.parameters?.[spec.name] : null);
  }

  /** @param {number} value @param {number} gesture */
  #set(value, gesture) {
    this.edits.parameter(gesture, this.spec.name, allowed(this.range, value));
  }

  /** @param {number} gesture */
  #reset(gesture) {
    if (this.slider.input.disabled) return;
    this.#set(this.spec.default, gesture);
    this.edits.end();
  }
}

/** @param {Model} model @param {Edits} edits */
export function parameterRows(model, edits) {
  const list = byId("parameters", HTMLElement);
  const take = byId("take", HTMLSelectElement);
  /** @type {ParameterRow[]} */
  let rows = [];
  let table = "";
  take.addEventListener("change", () => {
    if (take.value) edits.take(take.value);
    take.value = "";
  });
  model.on(["scene"], () => {
    // The scene is told again when its file changes; rows that are in use stay.
    const next = JSON.stringify(model.scene?.parameters ?? []);
    if (next === table) return;
    table = next;
    rows = (model.scene?.parameters ?? []).map((spec) => new ParameterRow(spec, model, edits));
    list.replaceChildren(...rows.map((row) => row.root));
  });
  model.on(["scene", "state", "viewing", "image"], () => {
    for (const row of rows) row.update();
    const source = model.edited;
    setText(byId("values-of", HTMLElement), SOURCE_NAMES[source].toLowerCase());
    byId("values-note", HTMLElement).hidden = source === "hand";
    for (const option of take.options)
      option.disabled =
        option.value === "" || !CONFIG_SOURCES.some((each) => each === option.value && !model.missing(each));
  });
}
