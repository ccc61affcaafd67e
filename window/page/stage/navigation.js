/**
 * Pointer and wheel on the stage: orbit, pan, dolly; a press without a drag is a click on the surface.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/picks.js").Picks} Picks
 * @typedef {import("./camera_moves.js").CameraMoves} CameraMoves
 * @typedef {import("./flight.js").Flight} Flight
 * @typedef {import("../types.js").Camera} Camera
 * @typedef {import("../types.js").Picked} Picked
 * @typedef {import("../types.js").Vector} Vector
 * @typedef {import("../maths/projection.js").Place} Place
 */
import { byId } from "../controls/elements.js";
import { dollied, eyeOf, orbited, panned } from "../maths/camera.js";
import { rayThrough } from "../maths/projection.js";
import { distance, moved } from "../maths/vectors.js";

/** Radians for each pixel of a drag: 0.3°. A choice. */
const TURN_OF_PIXEL = Math.PI / 600;
/** Pixels that a press may stray and still be a click. */
const CLICK_REACH = 4;
/** Wheel units of one notch, as browsers report a mouse's. */
const NOTCH = 100;
/** Pixels of a line, and of a page, where a wheel counts in those. */
const LINE = 33;
const PAGE = 400;

export class Navigation {
  /** Called instead of orbiting by a press, where a tool waits for one.
   * @type {((picked: Picked) => void) | null} */
  clickTool = null;
  /** Surface the wheel moves towards, where the pointer was then, and where the wheel has left the camera.
   * @type {{place: Place, point: Vector, camera: Camera} | null} */
  #aim = null;

  /** @param {Model} model @param {CameraMoves} moves @param {Picks} picks @param {Flight} flight */
  constructor(model, moves, picks, flight) {
    this.model = model;
    this.moves = moves;
    this.picks = picks;
    this.flight = flight;
    this.stage = byId("stage", HTMLElement);
    this.stage.addEventListener("pointerdown", (event) => this.#press(event));
    this.stage.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    this.stage.addEventListener("contextmenu", (event) => event.preventDefault());
    // A middle press would start the browser's own scrolling.
    this.stage.addEventListener("mousedown", (event) => event.button === 1 && event.preventDefault());
  }

  /** @param {MouseEvent} event @returns {Place} */
  placeOf(event) {
    const box = this.stage.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  }

  /** @param {PointerEvent} event */
  #press(event) {
    if (/** @type {Element} */ (event.target).closest("button, select, a, input")) return;
    this.stage.focus({ preventScroll: true });
    if (event.button === 2) {
      this.flight.begin(event);
      return;
    }
    if (event.button === 0 && this.clickTool) {
      const tool = this.clickTool;
      this.picks.ask(this.placeOf(event)).then(tool);
      return;
    }
    if (event.button > 1) return;
    const panning = event.button === 1 || event.shiftKey;
    this.#drag(event, panning ? this.#pan(event) : this.#orbit(event));
  }

  /** Follows a drag until the button is up.
   * @param {PointerEvent} down @param {(event: PointerEvent) => void} step */
  #drag(down, step) {
    const { stage } = this;
    let dragging = false;
    const move = (/** @type {PointerEvent} */ event) => {
      dragging ||= Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) > CLICK_REACH;
      if (dragging) step(event);
    };
    stage.setPointerCapture(down.pointerId);
    stage.classList.add("dragging");
    stage.addEventListener("pointermove", move);
    stage.addEventListener(
      "lostpointercapture",
      () => {
        stage.removeEventListener("pointermove", move);
        stage.classList.remove("dragging");
      },
      { once: true },
    );
  }

  /** @param {PointerEvent} down */
  #orbit(down) {
    const { moves } = this;
    this.picks.ask(this.placeOf(down)).then(({ position }) => {
      if (position) moves.pivot = position;
    });
    let [x, y] = [down.clientX, down.clientY];
    return (/** @type {PointerEvent} */ event) => {
      const turn = [(x - event.clientX) * TURN_OF_PIXEL, (y - event.clientY) * TURN_OF_PIXEL];
      [x, y] = [event.clientX, event.clientY];
      moves.set(orbited(moves.camera, moves.pivotOrMiddle, turn[0], turn[1]));
    };
  }

  /** @param {PointerEvent} down */
  #pan(down) {
    const { moves } = this;
    const begin = moves.camera;
    const ray = rayThrough(begin, moves.aspect, this.placeOf(down));
    // Until the surface is known, the one under the pointer is taken to be as far as the pivot.
    let point = moved(ray.origin, ray.direction, distance(eyeOf(begin), moves.pivotOrMiddle));
    let place = this.placeOf(down);
    let dragged = false;
    const step = () => moves.set(panned(begin, point, rayThrough(begin, moves.aspect, place).direction));
    this.picks.ask(place).then(({ position }) => {
      if (!position) return;
      point = position;
      moves.pivot = position;
      if (dragged && this.stage.classList.contains("dragging")) step();
    });
    return (/** @type {PointerEvent} */ event) => {
      dragged = true;
      place = this.placeOf(event);
      step();
    };
  }

  /** @param {WheelEvent} event */
  #wheel(event) {
    if (/** @type {Element} */ (event.target).closest("select")) return;
    event.preventDefault();
    const unit =
      event.deltaMode === WheelEvent.DOM_DELTA_LINE
        ? LINE
        : event.deltaMode === WheelEvent.DOM_DELTA_PAGE
          ? PAGE
          : 1;
    const notches = (-event.deltaY * unit) / NOTCH;
    if (this.flight.flying) {
      this.flight.faster(notches);
      return;
    }
    const { moves } = this;
    const aim = this.#aimAt(this.placeOf(event));
    moves.set(dollied(moves.camera, aim.point, notches, this.model.diagonal));
    aim.camera = moves.camera;
  }

  /** The surface under the pointer; until it is known, a point as far as the pivot. @param {Place} place */
  #aimAt(place) {
    const box = this.stage.getBoundingClientRect();
    const strayed = (/** @type {Place} */ from) =>
      Math.hypot((from[0] - place[0]) * box.width, (from[1] - place[1]) * box.height) > CLICK_REACH;
    const { moves } = this;
    if (this.#aim && this.#aim.camera === moves.camera && !strayed(this.#aim.place)) return this.#aim;
    const ray = rayThrough(moves.camera, moves.aspect, place);
    const far = distance(eyeOf(moves.camera), moves.pivotOrMiddle);
    const aim = { place, point: moved(ray.origin, ray.direction, far), camera: moves.camera };
    this.#aim = aim;
    this.picks.ask(place).then(({ position }) => {
      if (!position) return;
      aim.point = position;
      moves.pivot = position;
    });
    return aim;
  }
}
