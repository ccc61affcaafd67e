/**
 * Asks for the surface at a place of the image.
 *
 * @typedef {import("./model.js").Model} Model
 * @typedef {import("./connection.js").Connection} Connection
 * @typedef {import("../types.js").Picked} Picked
 * @typedef {import("../maths/projection.js").Place} Place
 */

export class Picks {
  #id = 0;
  /** @type {Map<number, (picked: Picked) => void>} */ #waiting = new Map();

  /** @param {Model} model @param {Connection} connection */
  constructor(model, connection) {
    this.model = model;
    this.connection = connection;
  }

  /** The surface at a place of what is on the screen. Without a connection there is never an answer.
   * @param {Place} place @returns {Promise<Picked>} */
  ask([x, y]) {
    this.#id += 1;
    const id = this.#id;
    const { seenCamera: camera, viewing } = this.model;
    this.connection.send({ type: "pick", id, x, y, camera, seconds: viewing.seconds });
    return new Promise((resolve) => this.#waiting.set(id, resolve));
  }

  /** @param {Picked} picked */
  answered(picked) {
    this.#waiting.get(picked.id)?.(picked);
    this.#waiting.delete(picked.id);
  }

  /** No more answers will come. */
  clear() {
    this.#waiting.clear();
  }
}
