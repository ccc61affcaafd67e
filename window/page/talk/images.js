/**
 * Images from the server: decoded off the page's thread, shown newest first, and acknowledged once drawn.
 *
 * @typedef {import("./model.js").Model} Model
 * @typedef {import("./connection.js").Connection} Connection
 * @typedef {import("../types.js").ImageHeader} ImageHeader
 */
import { Freshness, mediaType, parsedImage } from "../maths/image_message.js";

export class Images {
  #arrival = 0;
  /** Looks whose image waits to be drawn. @type {number[]} */ #undrawn = [];

  /** @param {Model} model @param {Connection} connection */
  constructor(model, connection) {
    this.model = model;
    this.connection = connection;
    this.fresh = { a: new Freshness(), b: new Freshness() };
  }

  /** @param {ArrayBuffer} message */
  async receive(message) {
    const { header, bytes } = parsedImage(message);
    this.#arrival += 1;
    const arrival = this.#arrival;
    const bitmap = bytes.length
      ? await createImageBitmap(new Blob([/** @type {any} */ (bytes)], { type: mediaType(bytes) }))
      : null;
    this.#undrawn.push(header.look);
    if (this.fresh[header.pane].accepts(header.look, arrival)) {
      this.model.shown[header.pane]?.bitmap?.close();
      this.model.shown[header.pane] = { header, bitmap };
    } else {
      bitmap?.close();
    }
    this.model.changed("image");
  }

  /** The stage has drawn what there is: tells the server, also of dropped images, as it waits for each. */
  acknowledge() {
    for (const look of this.#undrawn) this.connection.send({ type: "shown", look });
    this.#undrawn = [];
  }

  /** Nobody waits for acknowledgements any more. */
  forget() {
    this.#undrawn = [];
  }
}
