/**
 * Saving and loading, undo and redo, and the marks of what is not saved.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/edits.js").Edits} Edits
 * @typedef {import("../talk/connection.js").Connection} Connection
 * @typedef {"config" | "sidecar" | "views"} What
 */
import { byId, setText } from "../controls/elements.js";

/** @type {What[]} */
const FILES = ["config", "sidecar", "views"];

const anyUnsaved = (/** @type {import("../types.js").State | null} */ state) =>
  Boolean(state?.unsaved || state?.unsaved_lights || state?.unsaved_views);

/** @param {Model} model @param {Edits} edits @param {Connection} connection
 * @returns {(what: What) => void} saves to the path in the menu */
export function fileMenu(model, edits, connection) {
  const menu = byId("file-menu", HTMLElement);
  const pathOf = (/** @type {What} */ what) => byId(`path-${what}`, HTMLInputElement);
  const save = (/** @type {What} */ what) => {
    edits.flush();
    const path = pathOf(what).value.trim();
    connection.send({
      type: "save",
      what,
      path: path === "" || path === model.scene?.paths[what] ? null : path,
    });
    menu.hidePopover();
  };
  for (const what of FILES) {
    byId(`save-${what}`, HTMLFormElement).addEventListener("submit", (event) => {
      event.preventDefault();
      save(what);
    });
  }
  byId("load", HTMLFormElement).addEventListener("submit", (event) => {
    event.preventDefault();
    const path = byId("path-load", HTMLInputElement).value.trim();
    if (!path) return;
    connection.send({ type: "load", path });
    menu.hidePopover();
  });
  for (const type of /** @type {const} */ (["undo", "redo"])) {
    byId(type, HTMLElement).addEventListener("click", () => edits.history(type));
  }
  model.on(["scene"], () => {
    for (const what of FILES) {
      const field = pathOf(what);
      const usual = model.scene?.paths[what] ?? "";
      // What the user typed stays when the scene file changes.
      if (field.value === "" || field.value === field.dataset.usual) field.value = usual;
      field.dataset.usual = usual;
    }
  });
  model.on(["scene", "state"], () => {
    const { scene, state } = model;
    const unsaved = anyUnsaved(state);
    document.title = `${unsaved ? "● " : ""}${scene ? `${scene.name} – ` : ""}VPLtune`;
    setText(byId("scene-name", HTMLElement), scene?.name ?? "");
    byId("scene-name", HTMLElement).title = scene?.path ?? scene?.name ?? "";
    byId("unsaved", HTMLElement).classList.toggle("on", unsaved);
    byId("unsaved-config", HTMLElement).hidden = !state?.unsaved;
    byId("unsaved-sidecar", HTMLElement).hidden = !state?.unsaved_lights;
    byId("unsaved-views", HTMLElement).hidden = !state?.unsaved_views;
    for (const type of /** @type {const} */ (["undo", "redo"])) {
      const button = byId(type, HTMLButtonElement);
      const can = Boolean(type === "undo" ? state?.can_undo : state?.can_redo);
      const name = (type === "undo" ? state?.undo_name : state?.redo_name) ?? "";
      button.disabled = !can;
      button.title = can ? `${type === "undo" ? "Undo" : "Redo"} ${name}` : `Nothing to ${type}`;
      setText(/** @type {Element} */ (button.querySelector("span")), can ? name : "");
      button.setAttribute("aria-label", button.title);
    }
  });
  addEventListener("beforeunload", (event) => {
    if (anyUnsaved(model.state)) event.preventDefault();
  });
  return save;
}
