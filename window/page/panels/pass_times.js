/**
 * The time of each pass as one bar, with the budget on it.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/looks.js").Looks} Looks
 * @typedef {import("../talk/connection.js").Connection} Connection
 */
import { byId, element, setText } from "../controls/elements.js";
import { passBar } from "../maths/plots.js";
import { humanised, milliseconds } from "../maths/words.js";
import { SOURCE_NAMES } from "../types.js";

/** Passes that the legend names: the longest. */
const NAMED = 6;

/** @param {Model} model @param {Looks} looks @param {Connection} connection @returns {() => void} measures */
export function passTimes(model, looks, connection) {
  const bar = byId("pass-bar", HTMLElement);
  const legend = byId("pass-legend", HTMLElement);
  const total = byId("pass-total", HTMLElement);
  const button = byId("measure", HTMLButtonElement);
  let waiting = false;

  const update = () => {
    const { timings } = model;
    const budget = model.state?.budget_ms ?? null;
    button.disabled = waiting || !model.state;
    setText(button, waiting ? "Measuring…" : "Measure");
    if (!timings) {
      setText(total, budget ? `not measured yet; budget ${milliseconds(budget)}` : "not measured yet");
      return;
    }
    const laid = passBar(timings.passes, budget);
    const longest = [...laid.parts].sort((a, b) => b.milliseconds - a.milliseconds).slice(0, NAMED);
    const hue = new Map(longest.map((part, index) => [part, index]));
    bar.replaceChildren(
      ...laid.parts.map((part) => {
        const box = element("span", {
          class: "pass",
          title: `${humanised(part.name)}: ${milliseconds(part.milliseconds)}`,
          "data-pass": part.name,
          "data-hue": hue.get(part) ?? "other",
        });
        box.style.setProperty("--share", String(part.share));
        return box;
      }),
    );
    if (laid.budget !== null) {
      const line = element("span", { class: "budget", title: `budget ${milliseconds(budget ?? 0)}` });
      line.style.setProperty("--at", String(laid.budget));
      bar.append(line);
    }
    legend.replaceChildren(
      ...longest.map((part, index) =>
        element(
          "li",
          {},
          element("span", { class: "swatch", "data-hue": index }),
          element("span", { class: "name" }, humanised(part.name)),
          milliseconds(part.milliseconds),
        ),
      ),
    );
    const over = budget !== null && timings.milliseconds > budget;
    total.classList.toggle("over", over);
    const limit = budget === null ? "" : ` of ${milliseconds(budget)}`;
    setText(
      total,
      `${SOURCE_NAMES[timings.source].toLowerCase()}: ${milliseconds(timings.milliseconds)}${limit}`,
    );
    bar.setAttribute(
      "aria-label",
      longest.map((part) => `${humanised(part.name)} ${milliseconds(part.milliseconds)}`).join(", "),
    );
  };
  model.on(["timings"], () => {
    waiting = false;
    update();
  });
  model.on(["connection"], () => {
    waiting &&= model.connected;
    update();
  });
  model.on(["state"], update);
  const measure = () => {
    if (button.disabled) return;
    waiting = true;
    update();
    connection.send({
      type: "measure",
      source: model.edited,
      camera: model.viewing.camera,
      size: looks.size,
    });
  };
  button.addEventListener("click", measure);
  return measure;
}
