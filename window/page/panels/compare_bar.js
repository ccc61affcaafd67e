/**
 * What panes a and b show, the layer, and what the error is of.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/looks.js").Looks} Looks
 * @typedef {import("../types.js").Source} Source
 * @typedef {import("../types.js").Pane} Pane
 * @typedef {import("../types.js").ConfigSource} ConfigSource
 */
import { byId, element, setAttribute } from "../controls/elements.js";
import { humanised } from "../maths/words.js";
import { CONFIG_SOURCES, SOURCES, SOURCE_NAMES, hasConfig, isError } from "../types.js";

export class CompareBar {
  /** @param {Model} model @param {Looks} looks */
  constructor(model, looks) {
    this.model = model;
    this.looks = looks;
    this.right = byId("pane-b", HTMLSelectElement);
    this.layer = byId("layer", HTMLSelectElement);
    this.errorOf = byId("error-of", HTMLSelectElement);
    this.buttons = SOURCES.map((source, index) => {
      const button = element(
        "button",
        { type: "button", "data-source": source, "aria-pressed": "false" },
        SOURCE_NAMES[source],
      );
      button.append(element("span", { class: "badge", "aria-hidden": true }));
      button.dataset.key = String(index + 1);
      button.addEventListener("click", (event) => this.show(event.shiftKey ? "b" : "a", source));
      byId("pane-a", HTMLElement).append(button);
      this.right.append(element("option", { value: source }, SOURCE_NAMES[source]));
      return button;
    });
    this.errorOf.append(
      ...CONFIG_SOURCES.map((source) =>
        element("option", { value: source }, SOURCE_NAMES[source].toLowerCase()),
      ),
    );
    this.right.addEventListener("change", () =>
      this.show("b", /** @type {Source} */ (this.right.value) || null),
    );
    byId("swap", HTMLElement).addEventListener("click", () => this.swap());
    this.layer.addEventListener("change", () => this.#set({ layer: this.layer.value }));
    this.errorOf.addEventListener("change", () =>
      this.#set({ errorOf: /** @type {ConfigSource} */ (this.errorOf.value) }),
    );
    model.on(["scene"], () =>
      this.layer.replaceChildren(
        ...(model.scene?.layers ?? []).map((layer) => element("option", { value: layer }, humanised(layer))),
      ),
    );
    model.on(["scene", "state", "viewing"], () => this.#update());
  }

  /** Puts a source into a pane; null ends the split. @param {Pane} pane @param {Source | null} source */
  show(pane, source) {
    if (source && this.model.missing(source)) return;
    // The error is that of the image last looked at.
    const errorOf = hasConfig(source) ? { errorOf: source } : {};
    this.#set({ [pane]: source, ...errorOf });
  }

  swap() {
    const { a, b } = this.model.viewing;
    if (!b) return;
    const { shown } = this.model;
    [shown.a, shown.b] = [shown.b, shown.a];
    this.#set({ a: b, b: a });
    this.model.changed("image");
  }

  /** Shows the next layer. */
  nextLayer() {
    const layers = this.model.scene?.layers ?? [];
    this.#set({ layer: layers[(layers.indexOf(this.model.viewing.layer) + 1) % layers.length] ?? "" });
  }

  /** @param {Record<string, any>} members */
  #set(members) {
    Object.assign(this.model.viewing, members);
    this.model.changed("viewing");
    this.looks.send();
  }

  #update() {
    const { model } = this;
    const { a, b, layer, errorOf } = model.viewing;
    for (const button of this.buttons) {
      const source = /** @type {Source} */ (button.dataset.source);
      const missing = model.missing(source);
      const panes = [a === source ? "A" : "", b === source ? "B" : ""].join("");
      button.disabled = missing !== "" || !model.state;
      button.title = missing
        ? `${SOURCE_NAMES[source]}: ${missing}`
        : `${SOURCE_NAMES[source]} (${button.dataset.key}); shift: in the right pane`;
      setAttribute(button, "aria-pressed", String(a === source));
      button.classList.toggle("in-b", b === source);
      const badge = /** @type {Element} */ (button.lastElementChild);
      badge.textContent = b ? panes : "";
    }
    for (const option of this.right.options) {
      const missing = option.value ? model.missing(/** @type {Source} */ (option.value)) : "";
      option.disabled = missing !== "";
      option.textContent = option.value
        ? SOURCE_NAMES[/** @type {Source} */ (option.value)] + (missing && ` (${missing})`)
        : "no split";
    }
    for (const option of this.errorOf.options)
      option.disabled = model.missing(/** @type {Source} */ (option.value)) !== "";
    this.right.value = b ?? "";
    this.layer.value = layer;
    this.errorOf.value = errorOf;
    byId("error-keys", HTMLElement).hidden = !isError(a) && !isError(b);
    byId("swap", HTMLButtonElement).disabled = !b;
  }
}
