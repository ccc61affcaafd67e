/**
 * Flying: with the right button held, the pointer turns the head, W A S D Q E move and the wheel sets the
 * speed.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("./camera_moves.js").CameraMoves} CameraMoves
 * @typedef {import("../types.js").Vector} Vector
 */
import { byId, setText } from "../controls/elements.js";
import { flown, looked } from "../maths/camera.js";
import { formatted } from "../maths/scales.js";
import { add, length, scaled } from "../maths/vectors.js";

/** Radians for each pixel: 0.2°. A choice. */
const TURN_OF_PIXEL = Math.PI / 900;
/** Diagonals of the scene a second, at first and within which bounds. Choices. */
const SPEED = 0.25;
const SLOWEST = 0.002;
const FASTEST = 5;
/** What a notch of the wheel multiplies the speed by. */
const FASTER = 1.25;
/** With shift held. */
const SPRINT = 3;
/** Longest time of one step in seconds: a stall of the page is no leap. */
const LONGEST_STEP = 0.1;

/** Right, up and backwards of each key, by its place on the keyboard. @type {Record<string, Vector>} */
const STEPS = {
  KeyW: [0, 0, -1],
  KeyS: [0, 0, 1],
  KeyA: [-1, 0, 0],
  KeyD: [1, 0, 0],
  KeyQ: [0, -1, 0],
  KeyE: [0, 1, 0],
};

export class Flight {
  flying = false;
  speed = SPEED;
  /** @type {Set<string>} */ #held = new Set();
  #fast = false;

  /** @param {Model} model @param {CameraMoves} moves */
  constructor(model, moves) {
    this.model = model;
    this.moves = moves;
    this.stage = byId("stage", HTMLElement);
  }

  /** @param {PointerEvent} down */
  begin(down) {
    const { stage, moves } = this;
    this.flying = true;
    this.#held.clear();
    let [x, y] = [down.clientX, down.clientY];
    const turn = (/** @type {PointerEvent} */ event) => {
      moves.set(
        looked(moves.camera, (x - event.clientX) * TURN_OF_PIXEL, (y - event.clientY) * TURN_OF_PIXEL),
      );
      [x, y] = [event.clientX, event.clientY];
    };
    stage.setPointerCapture(down.pointerId);
    stage.addEventListener("pointermove", turn);
    stage.addEventListener(
      "lostpointercapture",
      () => {
        stage.removeEventListener("pointermove", turn);
        this.flying = false;
        this.moves.pivot = null;
        this.#tell();
      },
      { once: true },
    );
    this.#tell();
    let last = performance.now();
    const frame = (/** @type {number} */ now) => {
      if (!this.flying) return;
      this.#step(Math.min(LONGEST_STEP, Math.max(0, (now - last) / 1000)));
      last = now;
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /** @param {KeyboardEvent} event
   * @param {boolean} down @returns {boolean} whether the key was one of flight's */
  key(event, down) {
    this.#fast = event.shiftKey;
    if (!down) this.#held.delete(event.code);
    if (!this.flying || !(event.code in STEPS)) return false;
    if (down) this.#held.add(event.code);
    return true;
  }

  /** @param {number} notches */
  faster(notches) {
    this.speed = Math.max(SLOWEST, Math.min(FASTEST, this.speed * FASTER ** notches));
    this.#tell();
  }

  /** @param {number} seconds */
  #step(seconds) {
    /** @type {Vector} */
    let way = [0, 0, 0];
    for (const code of this.#held) way = add(way, STEPS[code]);
    if (length(way) === 0) return;
    const reach = this.speed * (this.#fast ? SPRINT : 1) * this.model.diagonal * seconds;
    this.moves.set(flown(this.moves.camera, scaled(way, reach / length(way))));
  }

  #tell() {
    const label = byId("flight", HTMLElement);
    label.hidden = !this.flying;
    setText(
      label,
      `Flying at ${formatted(this.speed, 2)} scene diagonals a second  ·  W A S D Q E  ·  ` +
        "wheel: speed  ·  shift: faster",
    );
  }
}
