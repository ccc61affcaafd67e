/**
 * Finding and making elements.
 */

/** The element with an id, which the page must have.
 * @template {Element} T @param {string} id @param {new () => T} [kind] @returns {T} */
export function byId(id, kind) {
  const found = document.getElementById(id);
  if (!found || (kind && !(found instanceof kind))) throw new Error(`no ${kind?.name ?? "element"} #${id}`);
  return /** @type {any} */ (found);
}

/** A new element with attributes (`class`, `data-…`, `aria-…`; false leaves one out) and children.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag @param {Record<string, string | number | boolean>} [attributes]
 * @param {(Node | string)[]} children @returns {HTMLElementTagNameMap[K]} */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== false) made.setAttribute(name, value === true ? "" : String(value));
  }
  made.append(...children);
  return made;
}

/** A new SVG element. @param {string} tag @param {Record<string, string | number>} [attributes]
 * @param {SVGElement[]} children @returns {SVGElement} */
export function shape(tag, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  made.append(...children);
  return /** @type {SVGElement} */ (made);
}

/** One of the icons in index.html. @param {string} name */
export const icon = (name) =>
  shape(
    "svg",
    { class: "icon", "aria-hidden": "true", viewBox: "0 0 16 16" },
    shape("use", { href: `#icon-${name}` }),
  );

/** A small button that shows an icon. @param {string} name @param {string} label
 * @param {Record<string, string | number | boolean>} [attributes] */
export const iconButton = (name, label, attributes = {}) => {
  const button = element("button", {
    type: "button",
    class: "icon-button",
    title: label,
    "aria-label": label,
    ...attributes,
  });
  button.append(icon(name));
  return button;
};

/** Sets text only where it differs, so that selections and screen readers are left alone.
 * @param {Element} target @param {string} text */
export function setText(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

/** @param {Element} target @param {string} name @param {string | number | null} value null removes it */
export function setAttribute(target, name, value) {
  if (value === null) target.removeAttribute(name);
  else if (target.getAttribute(name) !== String(value)) target.setAttribute(name, String(value));
}

/** Whether the user types text there, so that letters are no shortcuts. @param {EventTarget | null} target */
export const takesText = (target) =>
  target instanceof HTMLSelectElement ||
  (target instanceof HTMLInputElement && !["range", "color", "checkbox"].includes(target.type));
