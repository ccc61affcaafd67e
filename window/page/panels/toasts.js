/**
 * Short notes in the lower left corner: news goes by itself, errors stay until they are dismissed.
 */
import { byId, element, iconButton } from "../controls/elements.js";

/** Milliseconds that news stays. */
const STAYS = 5000;
/** Most notes at a time; the oldest goes first. */
const MOST = 5;

/** @param {"info" | "error"} level @param {string} text */
export function toast(level, text) {
  const list = byId("toasts", HTMLElement);
  const same = [...list.children].find((each) => each.firstChild?.textContent === text);
  same?.remove();
  const note = element(
    "div",
    { class: `toast ${level}`, role: level === "error" ? "alert" : "status" },
    element("span", {}, text),
  );
  const dismiss = iconButton("remove", "Dismiss");
  dismiss.addEventListener("click", () => note.remove());
  note.append(dismiss);
  list.append(note);
  if (list.children.length > MOST) list.firstElementChild?.remove();
  if (level === "error") return;
  let timer = setTimeout(() => note.remove(), STAYS);
  note.addEventListener("pointerenter", () => clearTimeout(timer));
  note.addEventListener("pointerleave", () => {
    timer = setTimeout(() => note.remove(), STAYS);
  });
}
