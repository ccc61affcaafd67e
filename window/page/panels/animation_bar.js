/**
 * The time of the animation: play, scrub, rest pose.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/looks.js").Looks} Looks
 */
import { byId, setAttribute, setText } from "../controls/elements.js";
import { clock } from "../maths/words.js";

/** @param {Model} model @param {Looks} looks @returns {() => void} plays, or stops */
export function animationBar(model, looks) {
  const bar = byId("animation", HTMLElement);
  const slider = byId("seconds", HTMLInputElement);
  const play = byId("play", HTMLButtonElement);
  const rest = byId("rest-pose", HTMLButtonElement);

  const goTo = (/** @type {number | null} */ seconds) => {
    model.viewing.seconds = seconds;
    model.changed("viewing");
    looks.input();
  };
  const toggle = () => {
    const length = model.scene?.seconds ?? 0;
    if (!(length > 0)) return;
    looks.playing = !looks.playing;
    model.changed("viewing");
    if (!looks.playing) {
      looks.input();
      return;
    }
    const begin = performance.now() / 1000 - (model.viewing.seconds ?? 0);
    let asked = -1;
    const frame = () => {
      if (!looks.playing) return;
      // The next time is asked for once the image of the last one is there: time is real, frames are as many
      // as the server draws.
      if ((model.shown.a?.header.look ?? -1) >= asked && model.connected) {
        asked = model.look + 1;
        goTo((performance.now() / 1000 - begin) % length);
      }
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  };
  play.addEventListener("click", toggle);
  slider.addEventListener("input", () => {
    looks.playing = false;
    goTo(Number(slider.value));
  });
  rest.addEventListener("click", () => {
    looks.playing = false;
    goTo(null);
  });
  model.on(["scene", "viewing"], () => {
    const length = model.scene?.seconds ?? 0;
    const { seconds } = model.viewing;
    bar.hidden = !(length > 0);
    slider.max = String(length);
    slider.value = String(seconds ?? 0);
    slider.style.setProperty("--place", String(length > 0 ? (seconds ?? 0) / length : 0));
    setAttribute(slider, "aria-valuetext", seconds === null ? "rest pose" : clock(seconds));
    setText(
      byId("clock", HTMLElement),
      seconds === null ? "rest pose" : `${clock(seconds)} / ${clock(length)}`,
    );
    setAttribute(rest, "aria-pressed", String(seconds === null));
    setAttribute(play, "aria-label", looks.playing ? "Stop" : "Play");
    play.title = looks.playing ? "Stop (space)" : "Play (space)";
    setAttribute(
      /** @type {Element} */ (play.querySelector("use")),
      "href",
      looks.playing ? "#icon-stop" : "#icon-play",
    );
  });
  return toggle;
}
