/**
 * Names, times and sizes as people read them.
 */
import { formatted } from "./scales.js";

/** Terms that are not written in small letters. @type {Record<string, string>} */
const SPELLED = {
  vpl: "VPL",
  vpls: "VPLs",
  rsm: "RSM",
  flip: "FLIP",
  lloyd: "Lloyd",
  "g buffer": "G-buffer",
};

/** "falloff_footprint" → "falloff footprint"; "vpl_count" → "VPL count". @param {string} name */
export const humanised = (name) =>
  name.replaceAll("_", " ").replace(/\b(?:vpls?|rsm|flip|lloyd|g buffer)\b/g, (word) => SPELLED[word]);

/** The same with a capital. @param {string} name */
export function titled(name) {
  const words = humanised(name);
  return words.charAt(0).toUpperCase() + words.slice(1);
}

/** @param {number} milliseconds */
export const milliseconds = (milliseconds) =>
  milliseconds >= 9950
    ? `${formatted(milliseconds / 1000, 3)} s`
    : `${formatted(milliseconds, milliseconds < 1 ? 2 : 3)} ms`;

/** @param {number} share in [0, 1] */
export const percent = (share) => `${Math.floor(100 * share + 1e-9)} %`;

/** @param {number} seconds */
export function timeLeft(seconds) {
  const whole = Math.max(0, Math.ceil(seconds));
  if (whole < 60) return `${whole} s left`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s left`;
  return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min left`;
}

/** @param {number} seconds of an animation */
export const clock = (seconds) => `${seconds.toFixed(2)} s`;
