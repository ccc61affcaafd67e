/**
 * A number that is typed, stepped with the arrow keys or dragged by its label.
 *
 * @typedef {{
 *   set: (value: number, gesture: number) => void,
 *   begin: () => number,
 *   end: () => void,
 *   step: (value: number, steps: number, fine: boolean) => number,
 *   format?: (value: number) => string,
 * }} NumberUse  `begin` gives the number of a gesture; `step` says where arrow keys and drags lead
 */
import { element, setAttribute } from "./elements.js";
import { formatted, typedNumber } from "../maths/scales.js";

/** Pixels of a drag that count as one press of an arrow key. A choice. */
const PIXELS_OF_STEP = 3;
/** Pixels that a press may stray before it is a drag. */
const DRAG_AFTER = 3;

export class NumberField {
  value = NaN;
  #typing = false;
  /** Number of the gesture while keys or pointer are down. */ #gesture = 0;

  /** @param {string} label for screen readers @param {NumberUse} use
   * @param {Record<string, string | number | boolean>} [attributes] of the input */
  constructor(label, use, attributes = {}) {
    this.use = use;
    this.input = element("input", {
      type: "text",
      inputmode: "decimal",
      class: "number",
      "aria-label": label,
      autocomplete: "off",
      spellcheck: "false",
      ...attributes,
    });
    this.input.addEventListener("focus", () => this.input.select());
    this.input.addEventListener("input", () => {
      this.#typing = true;
    });
    this.input.addEventListener("blur", () => {
      if (this.#gesture) this.#release();
      this.#commit();
    });
    this.input.addEventListener("keydown", (event) => this.#key(event));
    this.input.addEventListener("keyup", (event) => {
      if (event.key.startsWith("Arrow") && this.#gesture) this.#release();
    });
  }

  /** Shows a value, unless the user is typing another. @param {number | null} value */
  show(value) {
    this.value = value ?? NaN;
    if (this.#typing) return;
    const text = value === null ? "" : (this.use.format ?? formatted)(value);
    if (this.input.value !== text) this.input.value = text;
  }

  /** @param {boolean} on @param {string} [why] */
  enable(on, why = "") {
    this.input.readOnly = !on;
    setAttribute(this.input, "aria-readonly", on ? null : "true");
    if (why) this.input.title = why;
    else this.input.removeAttribute("title");
  }

  /** Dragging `handle` sideways changes the value, with shift finer. @param {HTMLElement} handle */
  draggedBy(handle) {
    handle.classList.add("scrub");
    handle.addEventListener("pointerdown", (down) => {
      if (down.button !== 0 || this.input.readOnly || Number.isNaN(this.value)) return;
      let last = down.clientX;
      let dragging = false;
      const move = (/** @type {PointerEvent} */ event) => {
        if (!dragging && Math.abs(event.clientX - down.clientX) < DRAG_AFTER) return;
        if (!dragging) {
          dragging = true;
          last = event.clientX;
          this.#gesture = this.use.begin();
          document.body.classList.add("scrubbing");
        }
        const steps = (event.clientX - last) / PIXELS_OF_STEP;
        const to = this.use.step(this.value, steps, event.shiftKey);
        // A whole number waits until the drag is long enough.
        if (to === this.value) return;
        last = event.clientX;
        this.#set(to);
      };
      const up = () => {
        handle.removeEventListener("pointermove", move);
        document.body.classList.remove("scrubbing");
        if (dragging) this.#release();
      };
      handle.setPointerCapture(down.pointerId);
      handle.addEventListener("pointermove", move);
      handle.addEventListener("lostpointercapture", up, { once: true });
    });
  }

  /** @param {number} value */
  #set(value) {
    this.#typing = false;
    this.show(value);
    this.use.set(value, this.#gesture);
  }

  #release() {
    this.#gesture = 0;
    this.use.end();
  }

  #commit() {
    if (!this.#typing) return;
    this.#typing = false;
    const value = typedNumber(this.input.value);
    if (value === null || value === this.value) {
      this.show(Number.isNaN(this.value) ? null : this.value);
      return;
    }
    this.#gesture = this.use.begin();
    this.#set(value);
    this.#release();
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    if (event.key === "Enter") {
      this.#commit();
      this.input.select();
    } else if (event.key === "Escape" && this.#typing) {
      this.#typing = false;
      this.show(Number.isNaN(this.value) ? null : this.value);
      this.input.select();
      event.stopPropagation();
    } else if (event.key === "ArrowUp" || event.key === "ArrowDown") {
      event.preventDefault();
      if (this.input.readOnly || Number.isNaN(this.value)) return;
      this.#commit();
      this.#gesture ||= this.use.begin();
      this.#set(this.use.step(this.value, event.key === "ArrowUp" ? 1 : -1, event.shiftKey));
    }
  }
}
