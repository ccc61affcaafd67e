/**
 * A row for each quality setting: a list of choices, or a slider.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/edits.js").Edits} Edits
 * @typedef {import("../types.js").Quality} Quality
 * @typedef {import("../types.js").QualityValue} QualityValue
 * @typedef {{inputs: HTMLElement[], show: (value: QualityValue) => void}} Control
 */
import { byId, element } from "../controls/elements.js";
import { NumberField } from "../controls/number_field.js";
import { Slider } from "../controls/slider.js";
import { allowed, formatted, rangeOfBounds, stepped } from "../maths/scales.js";
import { humanised } from "../maths/words.js";

/** What a setting says that is left to the program. */
const AUTOMATIC = "auto";

/** @param {Quality} spec @param {Edits} edits @returns {Control} */
function choiceOf(spec, edits) {
  const choices = spec.choices ?? [];
  const select = element("select", { "aria-label": humanised(spec.name) });
  select.append(
    ...choices.map((choice, index) =>
      element("option", { value: index }, choice === null ? AUTOMATIC : humanised(String(choice))),
    ),
  );
  select.addEventListener("change", () => {
    edits.quality(edits.gesture(), spec.name, choices[Number(select.value)]);
    edits.end();
  });
  return {
    inputs: [select],
    show: (value) => {
      select.value = String(choices.indexOf(value));
    },
  };
}

/** @param {Quality} spec @param {Edits} edits @returns {Control} */
function rangeOf(spec, edits) {
  const range = rangeOfBounds(Number(spec.low), Number(spec.high));
  const name = humanised(spec.name);
  const use = {
    begin: () => edits.gesture(),
    set: (/** @type {number} */ value, /** @type {number} */ gesture) =>
      edits.quality(gesture, spec.name, allowed(range, value)),
    end: () => edits.end(),
  };
  const slider = new Slider(range, name, use);
  const number = new NumberField(`${name}, value`, {
    ...use,
    step: (value, steps, fine) => stepped(range, value, steps, fine),
  });
  number.input.placeholder = AUTOMATIC;
  return {
    inputs: [slider.root, number.input],
    show: (value) => {
      slider.root.classList.toggle("automatic", typeof value !== "number");
      slider.show(
        typeof value === "number" ? value : range.low,
        typeof value === "number" ? formatted(value) : AUTOMATIC,
      );
      number.show(typeof value === "number" ? value : null);
    },
  };
}

/** @param {Model} model @param {Edits} edits */
export function qualityRows(model, edits) {
  const list = byId("qualities", HTMLElement);
  /** @type {{name: string, show: (value: QualityValue) => void}[]} */
  let rows = [];
  let table = "";
  model.on(["scene"], () => {
    const next = JSON.stringify(model.scene?.qualities ?? []);
    if (next === table) return;
    table = next;
    rows = [];
    list.replaceChildren(
      ...(model.scene?.qualities ?? []).map((spec) => {
        const { inputs, show } = spec.choices ? choiceOf(spec, edits) : rangeOf(spec, edits);
        rows.push({ name: spec.name, show });
        const meaning = element(
          "span",
          { class: "for-readers", id: `meaning-of-${spec.name}` },
          spec.meaning,
        );
        for (const input of inputs)
          (input.querySelector("input") ?? input).setAttribute("aria-describedby", meaning.id);
        return element(
          "div",
          {
            class: "row quality",
            role: "group",
            "aria-label": humanised(spec.name),
            "data-quality": spec.name,
          },
          element("span", { class: "name", title: spec.meaning }, humanised(spec.name)),
          meaning,
          ...inputs,
        );
      }),
    );
  });
  model.on(["scene", "state", "viewing"], () => {
    const source = model.edited;
    const kept = (model.state?.configs[source] ?? model.state?.configs.hand)?.quality;
    for (const row of rows) {
      const said = kept?.[row.name] ?? null;
      row.show(source === "hand" ? model.current(`quality ${row.name}`, said) : said);
    }
  });
}
