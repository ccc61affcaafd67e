/**
 * The one place that sets the camera: at once, or as a short eased move.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/looks.js").Looks} Looks
 * @typedef {import("../types.js").Camera} Camera
 * @typedef {import("../types.js").Vector} Vector
 */
import { cameraBetween, eyeOf, forwardOf, framed, orbited } from "../maths/camera.js";
import { dot, mixed, moved, subtract } from "../maths/vectors.js";

/** Milliseconds of an eased move. */
const DURATION = 280;
/** Radians that an arrow key orbits by: 5°. */
const KEY_TURN = Math.PI / 36;
/** Least distance of a pivot that no pick has set, in diagonals. */
const NEAREST_PIVOT = 0.1;

export class CameraMoves {
  /** Surface that was picked last. @type {Vector | null} */ pivot = null;
  /** Counts moves: an eased move ends when another begins. */ #move = 0;

  /** @param {Model} model @param {Looks} looks */
  constructor(model, looks) {
    this.model = model;
    this.looks = looks;
  }

  get camera() {
    return this.model.viewing.camera;
  }

  get aspect() {
    return this.looks.size[0] / this.looks.size[1] || 1;
  }

  /** What the camera turns about: the last picked surface, or the depth of the scene's middle.
   * @returns {Vector} */
  get pivotOrMiddle() {
    if (this.pivot) return this.pivot;
    const [low, high] = this.model.scene?.bounds ?? [
      [0, 0, 0],
      [0, 0, 0],
    ];
    const depth = dot(subtract(mixed(low, high, 0.5), eyeOf(this.camera)), forwardOf(this.camera));
    return moved(
      eyeOf(this.camera),
      forwardOf(this.camera),
      Math.max(depth, NEAREST_PIVOT * this.model.diagonal),
    );
  }

  /** @param {Camera} camera */
  set(camera) {
    this.#move += 1;
    this.#apply(camera);
  }

  /** Goes there within a quarter of a second; at once for those who want less motion.
   * @param {Camera} camera */
  ease(camera) {
    this.pivot = null;
    this.#move += 1;
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.#apply(camera);
      return;
    }
    const from = this.camera;
    const move = this.#move;
    const begin = performance.now();
    const frame = () => {
      if (move !== this.#move) return;
      const share = Math.min(1, (performance.now() - begin) / DURATION);
      const eased = share * share * (3 - 2 * share);
      this.#apply(share < 1 ? cameraBetween(from, camera, eased) : camera);
      if (share < 1) requestAnimationFrame(frame);
    };
    frame();
  }

  /** Shows the whole scene. */
  frame() {
    if (this.model.scene) this.ease(framed(this.camera, this.model.scene.bounds, this.aspect));
  }

  /** Back to where the scene begins. */
  home() {
    if (this.model.scene) this.ease(this.model.scene.camera);
  }

  /** @param {string} key an arrow key @returns {boolean} whether it was one */
  key(key) {
    const turn = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[key];
    if (!turn) return false;
    this.set(orbited(this.camera, this.pivotOrMiddle, turn[0] * KEY_TURN, turn[1] * KEY_TURN));
    return true;
  }

  /** @param {Camera} camera */
  #apply(camera) {
    this.model.viewing.camera = camera;
    this.model.changed("viewing");
    this.looks.input();
  }
}
