/**
 * A slider over a range of any scale, with ticks, a band and a ghost on its track.
 *
 * @typedef {import("../maths/scales.js").Range} Range
 * @typedef {{set: (value: number, gesture: number) => void, begin: () => number, end: () => void}} SliderUse
 */
import { element, setAttribute } from "./elements.js";
import { placeOf, stepped, valueAt } from "../maths/scales.js";

/** Milliseconds within which a press belongs to the gesture before: a double-click is one undo step. */
const SAME_GESTURE = 500;
/** Arrow keys that a press of Page Up or Page Down stands for. */
const PAGE = 10;

export class Slider {
  value = NaN;
  gesture = 0;
  #held = false;
  #ended = -Infinity;

  /** @param {Range} range @param {string} label @param {SliderUse} use */
  constructor(range, label, use) {
    this.range = range;
    this.use = use;
    this.input = element("input", { type: "range", min: 0, max: 1, step: "any", "aria-label": label });
    /** @type {Record<"band" | "default" | "tuned" | "ghost", HTMLElement>} */
    this.marks = {
      band: element("span", { class: "mark band", hidden: true }),
      default: element("span", { class: "mark tick default", hidden: true }),
      tuned: element("span", { class: "mark tick tuned", hidden: true }),
      ghost: element("span", { class: "mark ghost", hidden: true }),
    };
    this.root = element(
      "span",
      { class: "slider" },
      element("span", { class: "track" }),
      ...Object.values(this.marks),
      this.input,
    );
    this.input.addEventListener("input", () => {
      this.#begin();
      this.#set(valueAt(range, Number(this.input.value)));
    });
    this.input.addEventListener("change", () => this.#end());
    this.input.addEventListener("keydown", (event) => this.#key(event));
    this.input.addEventListener("keyup", () => this.#end());
    this.input.addEventListener("blur", () => this.#end());
  }

  /** @param {number} value @param {string} text what a screen reader says of it */
  show(value, text) {
    this.value = value;
    const place = placeOf(this.range, value);
    // The browser moves the thumb itself while it is dragged; a whole number would make it jump.
    if (!this.#held) this.input.value = String(place);
    this.root.style.setProperty("--place", String(place));
    setAttribute(this.input, "aria-valuetext", text);
  }

  /** Moves a mark; null hides it.
   * @param {"default" | "tuned" | "ghost"} mark @param {number | null | undefined} value */
  mark(mark, value) {
    this.marks[mark].hidden = value === null || value === undefined;
    if (value !== null && value !== undefined)
      this.marks[mark].style.setProperty("--at", String(placeOf(this.range, value)));
  }

  /** @param {[number, number] | null | undefined} interval */
  band(interval) {
    const { band } = this.marks;
    band.hidden = !interval;
    if (!interval) return;
    const [from, to] = interval.map((value) => placeOf(this.range, value));
    band.style.setProperty("--at", String(from));
    band.style.setProperty("--wide", String(to - from));
  }

  /** @param {number} value */
  #set(value) {
    // Before the first state there is no value to step from.
    if (value === this.value || !Number.isFinite(value)) return;
    this.show(value, this.input.getAttribute("aria-valuetext") ?? "");
    this.use.set(value, this.gesture);
  }

  #begin() {
    if (this.#held) return;
    this.#held = true;
    if (performance.now() - this.#ended > SAME_GESTURE) this.gesture = this.use.begin();
  }

  #end() {
    if (!this.#held) return;
    this.#held = false;
    this.#ended = performance.now();
    this.input.value = String(placeOf(this.range, this.value));
    this.use.end();
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const steps = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: PAGE, PageDown: -PAGE }[
      event.key
    ];
    const end = { Home: this.range.low, End: this.range.high }[event.key];
    if ((steps === undefined && end === undefined) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    this.#begin();
    this.#set(
      steps === undefined
        ? /** @type {number} */ (end)
        : stepped(this.range, this.value, steps, event.shiftKey),
    );
    this.input.value = String(placeOf(this.range, this.value));
  }
}
