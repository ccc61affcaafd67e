/**
 * The line between panes a and b, dragged by pointer or moved with the arrow keys.
 *
 * @typedef {import("../talk/model.js").Model} Model
 */
import { byId, setAttribute } from "../controls/elements.js";

/** Share of the width that an arrow key moves the line by, and with shift. */
const STEP = 0.02;
const FINE_STEP = 0.002;

/** @param {Model} model */
export function splitLine(model) {
  const line = byId("split-line", HTMLElement);
  const stage = byId("stage", HTMLElement);
  const move = (/** @type {number} */ to) => {
    model.viewing.split = Math.max(0, Math.min(1, to));
    model.changed("viewing");
  };
  line.addEventListener("pointerdown", (event) => {
    event.stopPropagation();
    if (event.button === 0) line.setPointerCapture(event.pointerId);
  });
  line.addEventListener("pointermove", (event) => {
    if (!line.hasPointerCapture(event.pointerId)) return;
    const box = stage.getBoundingClientRect();
    move((event.clientX - box.left) / box.width);
  });
  line.addEventListener("dblclick", () => move(0.5));
  line.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? FINE_STEP : STEP;
    const to = {
      ArrowLeft: model.viewing.split - step,
      ArrowRight: model.viewing.split + step,
      Home: 0,
      End: 1,
    }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    move(to);
  });
  model.on(["viewing"], () => {
    line.hidden = !model.viewing.b;
    line.style.setProperty("--at", String(model.viewing.split));
    setAttribute(line, "aria-valuenow", Math.round(100 * model.viewing.split));
  });
}
