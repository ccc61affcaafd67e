/**
 * The panel: how wide it is, whether it is there, which of its sections are open. The tab remembers.
 */
import { byId, setAttribute } from "../controls/elements.js";

const KEPT = "vpltune layout";
/** Pixels: what the columns of a row need, and what leaves a stage beside it. Choices. */
const NARROWEST = 330;
const WIDEST = 640;
const USUAL = 384;
/** Pixels that an arrow key moves the border by. */
const STEP = 16;

/** @returns {() => void} shows the panel, or hides it */
export function panelLayout() {
  const border = byId("panel-border", HTMLElement);
  const toggle = byId("toggle-panel", HTMLElement);
  const sections = /** @type {HTMLDetailsElement[]} */ ([...document.querySelectorAll("#panel details")]);
  const kept = {
    width: USUAL,
    hidden: false,
    closed: /** @type {string[]} */ ([]),
    ...JSON.parse(sessionStorage.getItem(KEPT) ?? "{}"),
  };

  const apply = () => {
    kept.width = Math.round(Math.max(NARROWEST, Math.min(WIDEST, kept.width)));
    document.body.style.setProperty("--panel", `${kept.width}px`);
    document.body.classList.toggle("without-panel", kept.hidden);
    setAttribute(border, "aria-valuenow", kept.width);
    setAttribute(toggle, "aria-pressed", String(!kept.hidden));
    sessionStorage.setItem(KEPT, JSON.stringify(kept));
  };
  border.addEventListener(
    "pointerdown",
    (event) => event.button === 0 && border.setPointerCapture(event.pointerId),
  );
  border.addEventListener("pointermove", (event) => {
    if (!border.hasPointerCapture(event.pointerId)) return;
    kept.width = innerWidth - event.clientX;
    apply();
  });
  border.addEventListener("dblclick", () => {
    kept.width = USUAL;
    apply();
  });
  border.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: STEP, ArrowRight: -STEP }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    kept.width += step;
    apply();
  });
  for (const section of sections) {
    section.open = !kept.closed.includes(section.id);
    section.addEventListener("toggle", () => {
      kept.closed = sections.filter((each) => !each.open).map((each) => each.id);
      apply();
    });
  }
  const change = () => {
    kept.hidden = !kept.hidden;
    apply();
  };
  toggle.addEventListener("click", change);
  apply();
  return change;
}
