/**
 * Starts and stops a fit, and shows how it goes.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/connection.js").Connection} Connection
 */
import { byId, setAttribute, setText } from "../controls/elements.js";
import { lossPoints } from "../maths/plots.js";
import { formatted } from "../maths/scales.js";
import { humanised, percent, timeLeft, titled } from "../maths/words.js";

/** Size of the loss plot in its own units; the page stretches it. */
const PLOT_WIDTH = 200;
const PLOT_HEIGHT = 56;

/** @param {Model} model @param {Connection} connection
 * @returns {() => void} starts a fit, or stops the one that runs */
export function tunePanel(model, connection) {
  const button = byId("tune", HTMLButtonElement);
  const press = () => {
    if (button.disabled) return;
    if (model.state?.fit.running) connection.send({ type: "stop" });
    else connection.send({ type: "tune", camera: model.viewing.camera });
  };
  button.addEventListener("click", press);
  model.on(["scene", "state", "connection"], () => {
    const fit = model.state?.fit;
    const reason = model.scene?.tuning ?? null;
    const running = fit?.running ?? false;
    button.disabled = !fit || !model.connected || (reason !== null && !running);
    setText(/** @type {Element} */ (button.querySelector("span")), running ? "Stop" : "Tune");
    button.classList.toggle("running", running);
    button.title =
      reason ??
      (running
        ? "Stop; what was found so far stays (T)"
        : "Fit the parameters to a path tracer in this view and the kept ones (T)");
    const progress = byId("fit-progress", HTMLElement);
    progress.classList.toggle("idle", !running);
    progress.style.setProperty("--share", String(running ? (fit?.share ?? 0) : 0));
    setAttribute(progress, "aria-valuenow", running ? Math.floor(100 * (fit?.share ?? 0)) : null);
    setText(byId("fit-stage", HTMLElement), running ? titled(fit?.stage ?? "") : "");
    setText(
      byId("fit-time", HTMLElement),
      !running || !fit
        ? ""
        : [percent(fit.share), fit.seconds_left === null ? "" : timeLeft(fit.seconds_left)]
            .filter(Boolean)
            .join("  ·  "),
    );
    /** @type {HTMLElement} */ (byId("fit-stage").parentElement).hidden = !running;
    const losses = fit?.losses ?? [];
    setAttribute(byId("loss-line", SVGElement), "points", lossPoints(losses, PLOT_WIDTH, PLOT_HEIGHT));
    setText(
      byId("loss-value", HTMLElement),
      losses.length ? `loss ${formatted(losses[losses.length - 1], 3)}` : "loss",
    );
    const status = byId("fit-status", HTMLElement);
    const said = reason !== null && !running ? reason : running ? "" : (fit?.sentence ?? "");
    setText(byId("fit-sentence", HTMLElement), said);
    setText(status, reason === null && !running && fit?.status ? humanised(fit.status) : "");
    status.hidden = status.textContent === "";
    status.dataset.status = fit?.status ?? "";
  });
  return press;
}
