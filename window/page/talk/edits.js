/**
 * Changes of the document: one gesture is one step of undo, and at most one value of each thing is sent in a
 * frame. Until the server has sent a value back, the page shows the one it sent.
 *
 * @typedef {import("./model.js").Model} Model
 * @typedef {import("./connection.js").Connection} Connection
 * @typedef {import("./looks.js").Looks} Looks
 * @typedef {import("../types.js").Light} Light
 */

/** Milliseconds after a gesture for which a sent value stands in for what the server has not sent back. */
const AWAITED = 1500;

export class Edits {
  // Numbers of this page begin where those of an earlier page, or of another browser, are not.
  #gesture = Date.now() * 1000;
  /** @type {Map<string, Record<string, any>>} */ #unsent = new Map();

  /** @param {Model} model @param {Connection} connection @param {Looks} looks */
  constructor(model, connection, looks) {
    this.model = model;
    this.connection = connection;
    this.looks = looks;
  }

  /** A number for a whole drag, or for one change. */
  gesture() {
    this.#gesture += 1;
    return this.#gesture;
  }

  /** @param {number} gesture @param {string} name @param {number} value */
  parameter(gesture, name, value) {
    this.#byHand();
    this.#set(`parameter ${name}`, value, { type: "edit", gesture, parameter: name, value });
  }

  /** @param {number} gesture @param {string} name @param {number | string | null} value */
  quality(gesture, name, value) {
    this.#byHand();
    this.#set(`quality ${name}`, value, { type: "edit", gesture, quality: name, value });
  }

  /** @param {number} gesture @param {number} index @param {Light} value */
  light(gesture, index, value) {
    this.#set(`light ${index}`, value, { type: "edit", gesture, light: index, value });
  }

  /** @param {Light} light */
  addLight(light) {
    this.#once({ type: "edit", gesture: this.gesture(), add_light: light });
  }

  /** @param {number} index */
  removeLight(index) {
    this.model.pending.clear();
    this.#once({ type: "edit", gesture: this.gesture(), remove_light: index });
  }

  /** Replaces the config by hand. @param {string} source */
  take(source) {
    this.#byHand();
    this.#once({ type: "edit", gesture: this.gesture(), take: source });
  }

  /** @param {"undo" | "redo"} type */
  history(type) {
    this.flush();
    this.model.pending.clear();
    this.#once({ type });
  }

  /** Sends what waits for the next frame. */
  flush() {
    for (const message of this.#unsent.values()) this.connection.send(/** @type {any} */ (message));
    this.#unsent.clear();
  }

  /** The server has sent the document: what it has taken over is no longer pending. */
  received() {
    const { pending, state } = this.model;
    for (const [key, { value, held }] of pending) {
      const [kind, name] = key.split(" ");
      const hand = state?.configs.hand;
      const said =
        kind === "light"
          ? state?.lights[+name]
          : (kind === "quality" ? hand?.quality : hand?.parameters)?.[name];
      if (!held && JSON.stringify(said) === JSON.stringify(value)) pending.delete(key);
    }
  }

  /** The gesture is over: sends the last value, and soon believes the server again. */
  end() {
    this.flush();
    const { model } = this;
    for (const entry of model.pending.values()) entry.held = false;
    const ended = [...model.pending];
    setTimeout(() => {
      for (const [key, entry] of ended)
        if (model.pending.get(key) === entry && !entry.held) model.pending.delete(key);
      model.changed("state");
    }, AWAITED);
  }

  #byHand() {
    const { viewing } = this.model;
    if (viewing.a === "hand") return;
    viewing.a = "hand";
    this.model.changed("viewing");
    this.looks.send();
  }

  /** @param {{type: string} & Record<string, any>} message */
  #once(message) {
    this.flush();
    this.connection.send(message);
    this.looks.editInput();
  }

  /** @param {string} key @param {any} value @param {Record<string, any>} message */
  #set(key, value, message) {
    this.model.pending.set(key, { value, held: true });
    if (this.#unsent.size === 0) requestAnimationFrame(() => this.flush());
    this.#unsent.set(key, message);
    this.looks.editInput();
    this.model.changed("state");
  }
}
