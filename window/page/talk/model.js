/**
 * What the page knows: what the server said, and what this browser looks at. Parts of the page change it and
 * tell with `changed`; those that show it listen with `on`.
 *
 * @typedef {import("../types.js").Camera} Camera
 * @typedef {import("../types.js").Config} Config
 * @typedef {import("../types.js").ConfigSource} ConfigSource
 * @typedef {import("../types.js").ImageHeader} ImageHeader
 * @typedef {import("../types.js").Light} Light
 * @typedef {import("../types.js").Pane} Pane
 * @typedef {import("../types.js").Scene} Scene
 * @typedef {import("../types.js").Source} Source
 * @typedef {import("../types.js").State} State
 * @typedef {import("../types.js").Timings} Timings
 * @typedef {import("../types.js").Vector} Vector
 * @typedef {"scene" | "state" | "viewing" | "image" | "timings" | "selection" | "connection"} Topic
 * @typedef {{header: ImageHeader, bitmap: ImageBitmap | null}} Shown
 */
import { distance } from "../maths/vectors.js";
import { hasConfig, isError } from "../types.js";

export class Model {
  /** @type {Scene | null} */ scene = null;
  /** @type {State | null} */ state = null;
  /** @type {Timings | null} */ timings = null;
  /** Newest image of each pane. @type {Record<Pane, Shown | null>} */ shown = { a: null, b: null };
  /** Index of the selected light, or -1. */ selected = -1;
  connected = false;
  /** Number of the newest look that was sent. */ look = 0;
  /** Whether the user is at it: images may be coarse. */ moving = false;
  /** What this browser looks at. `split` is the place of the line in [0, 1]. */
  viewing = {
    /** @type {Camera} */ camera: { to_world: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], yfov: 1 },
    /** @type {Source} */ a: "hand",
    /** @type {Source | null} */ b: null,
    split: 0.5,
    layer: "",
    /** @type {ConfigSource} */ errorOf: "hand",
    /** @type {number | null} */ seconds: null,
  };

  /** Values that were sent and have not come back. @type {Map<string, {value: any, held: boolean}>} */
  pending = new Map();

  /** In the order of `on`. @type {{topics: Topic[], listener: () => void}[]} */ #listeners = [];
  /** @type {Set<Topic>} */ #told = new Set();

  /** Calls `listener` once in the next frame after topics have changed. Listeners are called in the order in
   * which they came: what makes elements comes before what fills them, whichever topic changed first.
   * @param {Topic[]} topics @param {() => void} listener */
  on(topics, listener) {
    this.#listeners.push({ topics, listener });
  }

  /** @param {...Topic} topics */
  changed(...topics) {
    if (this.#told.size === 0) requestAnimationFrame(() => this.#tell());
    for (const topic of topics) this.#told.add(topic);
  }

  #tell() {
    const told = new Set(this.#told);
    this.#told.clear();
    for (const { topics, listener } of this.#listeners) if (topics.some((topic) => told.has(topic))) listener();
  }

  /** The source whose values the panel shows. @returns {ConfigSource} */
  get edited() {
    const { a, errorOf } = this.viewing;
    if (hasConfig(a)) return a;
    return isError(a) ? errorOf : "hand";
  }

  /** Why a source cannot be shown, or "". @param {Source} source */
  missing(source) {
    if (!this.state || !hasConfig(source) || this.state.configs[source]) return "";
    return { tuned: "no fit yet", auto: "no prior for this scene", default: "no default", hand: "no config" }[
      source
    ];
  }

  /** What the server says, or what was sent since. @param {string} key @param {any} said */
  current(key, said) {
    const sent = this.pending.get(key);
    return sent ? sent.value : said;
  }

  /** The lights as edited here. @returns {Light[]} */
  get lights() {
    return (this.state?.lights ?? []).map((light, index) => this.current(`light ${index}`, light));
  }

  /** Where the animation has the lights in the image shown, where it does. @returns {Light[] | null} */
  get posedLights() {
    return this.shown.a?.header.lights ?? null;
  }

  /** The camera of what is on the screen: the image's, as long as a newer one is under way. */
  get seenCamera() {
    const shown = this.shown.a;
    return shown?.bitmap ? shown.header.camera : this.viewing.camera;
  }

  /** Length of the diagonal of the scene's box, world units. */
  get diagonal() {
    return this.scene ? distance(...this.scene.bounds) || 1 : 1;
  }
}
