/**
 * Views of the file and kept views: a click goes there.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/connection.js").Connection} Connection
 * @typedef {import("../stage/camera_moves.js").CameraMoves} CameraMoves
 */
import { byId, element, iconButton } from "../controls/elements.js";
import { humanised } from "../maths/words.js";

/** The split of views that were kept in the window, which alone can be removed. */
const KEPT = "kept";

/** @param {Model} model @param {Connection} connection @param {CameraMoves} moves */
export function viewList(model, connection, moves) {
  const list = byId("view-list", HTMLElement);
  const name = byId("view-name", HTMLInputElement);
  let drawn = "";
  byId("keep-view", HTMLFormElement).addEventListener("submit", (event) => {
    event.preventDefault();
    const wanted = name.value.trim() || name.placeholder;
    connection.send({ type: "keep_view", name: wanted, camera: model.viewing.camera });
    name.value = "";
  });
  model.on(["state"], () => {
    const views = model.state?.views ?? [];
    const names = new Set(views.map((view) => view.name));
    let number = views.length + 1;
    while (names.has(`view ${number}`)) number += 1;
    name.placeholder = `view ${number}`;
    const next = JSON.stringify(views.map((view) => [view.name, view.split]));
    byId("no-views", HTMLElement).hidden = views.length > 0 || !model.state;
    if (next === drawn) return;
    drawn = next;
    list.replaceChildren(
      ...views.map((view, index) => {
        const go = element(
          "button",
          { type: "button", class: "go", title: `Go to ${view.name}` },
          element("span", { class: "name" }, view.name),
          element("small", {}, humanised(view.split ?? "")),
        );
        go.addEventListener("click", () => {
          const now = model.state?.views[index];
          if (now) moves.ease(now.camera);
        });
        const row = element("li", { class: "view", "data-view": view.name }, go);
        // The views of the file are the file's.
        if (view.split !== KEPT) return row;
        const remove = iconButton("remove", `Remove ${view.name}`);
        remove.addEventListener("click", () => connection.send({ type: "remove_view", name: view.name }));
        row.append(remove);
        return row;
      }),
    );
  });
}
