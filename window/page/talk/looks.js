/**
 * Tells the server what this browser wants to see: at most once in a frame, `moving` while the user is at it,
 * and once more when they have stopped.
 *
 * @typedef {import("./model.js").Model} Model
 * @typedef {import("./connection.js").Connection} Connection
 */

/** Milliseconds without input after which the image is drawn in full. */
const SETTLED_AFTER = 200;

export class Looks {
  /** Size of the canvas in device pixels. @type {[number, number]} */ size = [0, 0];
  /** While the animation plays, a slow frame is no pause. */ playing = false;
  #scheduled = false;
  /** @type {number | undefined} */ #timer;

  /** @param {Model} model @param {Connection} connection */
  constructor(model, connection) {
    this.model = model;
    this.connection = connection;
  }

  /** The user moves something of the view. */
  input() {
    this.#isMoving();
    this.send();
  }

  /** The user moves something of the document, which the server draws by itself: that it moves is news. */
  editInput() {
    if (!this.#isMoving()) this.send();
  }

  /** Something else has changed: looks again in the next frame. */
  send() {
    if (this.#scheduled) return;
    this.#scheduled = true;
    requestAnimationFrame(() => {
      this.#scheduled = false;
      this.#sendNow();
    });
  }

  /** @returns {boolean} whether it was moving already */
  #isMoving() {
    const { model } = this;
    const was = model.moving;
    model.moving = true;
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#settle(), SETTLED_AFTER);
    if (!was) model.changed("image");
    return was;
  }

  #settle() {
    if (this.playing) return;
    this.model.moving = false;
    this.model.changed("image");
    this.send();
  }

  #sendNow() {
    const { model, size } = this;
    if (!model.scene || !model.connected || size[0] < 1 || size[1] < 1) return;
    const { camera, a, b, layer, errorOf, seconds } = model.viewing;
    model.look += 1;
    this.connection.send({
      type: "look",
      look: model.look,
      camera,
      size,
      moving: model.moving,
      a,
      b,
      layer,
      error_of: errorOf,
      seconds,
    });
  }
}
