/**
 * What each pane shows and how far it is, in the upper corners of the stage; the key of error colours below.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../types.js").Pane} Pane
 */
import { byId, setText } from "../controls/elements.js";
import { formatted } from "../maths/scales.js";
import { milliseconds, percent } from "../maths/words.js";
import { SOURCE_NAMES, isError } from "../types.js";

/** @param {Model} model @param {Pane} pane */
function stateWords(model, pane) {
  const wanted = model.viewing[pane];
  const shown = model.shown[pane];
  const header = shown?.header;
  if (!header || header.source !== wanted) return "waiting…";
  const words = [];
  if (header.share !== undefined && header.share < 1)
    words.push(`${shown?.bitmap ? "" : "reference "}${percent(header.share)}`);
  if (shown?.bitmap) {
    if (model.moving) words.push("moving…");
    // Each look is answered with an image of each pane.
    else if (header.look < model.look) words.push("drawing…");
    else words.push(header.settled ? "settled" : "refining…");
    if (header.noise !== undefined && header.noise !== null)
      words.push(`noise ${formatted(header.noise, 2)}`);
    if (header.milliseconds > 0) words.push(milliseconds(header.milliseconds));
    words.push(`${header.size[0]} × ${header.size[1]}`);
  }
  return words.join("  ·  ");
}

/** @param {Model} model @param {Pane} pane */
function name(model, pane) {
  const source = model.viewing[pane];
  if (!source) return "";
  return isError(source)
    ? `${SOURCE_NAMES[source]} of ${SOURCE_NAMES[model.viewing.errorOf].toLowerCase()}`
    : SOURCE_NAMES[source];
}

/** Why a pane is empty, or "". @param {Model} model @param {Pane} pane */
function emptyWords(model, pane) {
  if (!model.viewing[pane]) return "";
  if (!model.scene) return "Waiting for the scene…";
  const shown = model.shown[pane];
  if (!shown) return "Waiting for the image…";
  if (shown.bitmap) return "";
  const share = percent(shown.header.share ?? 0);
  return `The reference of this view is at ${share}. The error is shown once it is there.`;
}

/** @param {Model} model */
export function paneLabels(model) {
  const update = () => {
    for (const pane of /** @type {const} */ (["a", "b"])) {
      const label = byId(`label-${pane}`, HTMLElement);
      label.hidden = !model.viewing[pane];
      setText(label.querySelector("b") ?? label, name(model, pane));
      setText(label.querySelector("span") ?? label, stateWords(model, pane));
      const header = model.shown[pane]?.header;
      const bar = byId(`progress-${pane}`, HTMLElement);
      const share = header?.source === model.viewing[pane] ? header?.share : undefined;
      bar.hidden = share === undefined || share >= 1;
      bar.style.setProperty("--share", String(share ?? 0));
      const message = byId(`message-${pane}`, HTMLElement);
      setText(message, emptyWords(model, pane));
      message.hidden = message.textContent === "";
      const left = model.viewing.b ? model.viewing.split : 1;
      message.style.setProperty("--wide", String(pane === "a" ? left : 1 - left));
    }
    const { a, b } = model.viewing;
    byId("key-signed_error", HTMLElement).hidden = a !== "signed_error" && b !== "signed_error";
    byId("key-flip", HTMLElement).hidden = a !== "flip" && b !== "flip";
  };
  model.on(["image", "viewing", "scene", "state"], update);
}
