/**
 * The keys, and the overlay that lists them.
 *
 * @typedef {{keys: string, does: string, group: string, run?: (event: KeyboardEvent) => void,
 *   match?: (event: KeyboardEvent) => boolean}} Shortcut
 */
import { byId, element, takesText } from "./controls/elements.js";

/** Parts of a description of keys that are no keys. */
const JOINING = ["+", "…"];

/** Whether a letter was pressed alone. @param {string} letter @returns {(event: KeyboardEvent) => boolean} */
export const plain = (letter) => (event) =>
  !event.ctrlKey && !event.metaKey && !event.altKey && event.key.toLowerCase() === letter.toLowerCase();

/** The digit of the main keyboard or the number block that was pressed, whatever shift makes of it; else -1.
 * @param {KeyboardEvent} event */
export const digitOf = (event) =>
  event.ctrlKey || event.metaKey || event.altKey
    ? -1
    : Number(/^(?:Digit|Numpad)([0-7])$/.exec(event.code)?.[1] ?? -1);

/** Whether a letter was pressed with Ctrl, or with ⌘. @param {string} letter @param {boolean} [shift]
 * @returns {(event: KeyboardEvent) => boolean} */
export const withCommand =
  (letter, shift = false) =>
  (event) =>
    (event.ctrlKey || event.metaKey) &&
    !event.altKey &&
    event.shiftKey === shift &&
    event.key.toLowerCase() === letter;

/** @param {Shortcut[]} shortcuts the first that matches is run; those without `run` are only listed
 * @param {{key: (event: KeyboardEvent, down: boolean) => boolean}} flight gets keys first */
export function shortcutKeys(shortcuts, flight) {
  const overlay = byId("help", HTMLDialogElement);
  const groups = [...new Set(shortcuts.map((each) => each.group))];
  byId("key-list", HTMLElement).append(
    ...groups.map((group) =>
      element(
        "section",
        {},
        element("h3", {}, group),
        element(
          "dl",
          {},
          ...shortcuts
            .filter((each) => each.group === group && each.keys)
            .flatMap((each) => [
              element(
                "dt",
                {},
                ...each.keys
                  .split(" ")
                  .flatMap((key, index) => [
                    ...(index ? [" "] : []),
                    JOINING.includes(key) ? key : element("kbd", {}, key),
                  ]),
              ),
              element("dd", {}, each.does),
            ]),
        ),
      ),
    ),
  );
  addEventListener("keyup", (event) => flight.key(event, false));
  addEventListener("keydown", (event) => {
    if (flight.key(event, true)) {
      event.preventDefault();
      return;
    }
    const { target } = event;
    const command = event.ctrlKey || event.metaKey;
    // Text fields keep their letters and their own undo, but Ctrl+S saves from everywhere.
    if (takesText(target) && !(command && event.key.toLowerCase() === "s")) return;
    if (overlay.open && event.key !== "?") return;
    const onButton =
      target instanceof Element && target.closest("button, summary, input, [role=separator]") !== null;
    if (event.key === " " && onButton) return;
    const found = shortcuts.find((each) => each.run && each.match?.(event));
    if (!found) return;
    event.preventDefault();
    if (!event.repeat || event.key.startsWith("Arrow") || command) found.run?.(event);
  });
  byId("close-help", HTMLElement).addEventListener("click", () => overlay.close());
  overlay.addEventListener("click", (event) => event.target === overlay && overlay.close());
}

/** Opens the overlay, or closes it. */
export function toggleHelp() {
  const overlay = byId("help", HTMLDialogElement);
  if (overlay.open) overlay.close();
  else overlay.showModal();
}
