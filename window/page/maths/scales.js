/**
 * Places on a slider's track, in [0, 1], and values.
 *
 * @typedef {{low: number, high: number, scale: "linear" | "log" | "log_from_zero", whole: boolean}} Range
 */

/** Steps of an arrow key along the track, and with shift. A choice. */
const STEP = 0.01;
const FINE_STEP = 0.001;

/** Significant digits of a value set here: those that are shown, so that a file holds what was seen. */
const DIGITS = 4;

/** @param {Range} range @param {number} value @returns {number} within the range, whole where it must be */
export function allowed(range, value) {
  const rounded = range.whole ? Math.round(value) : Number(value.toPrecision(DIGITS));
  return Math.max(range.low, Math.min(range.high, rounded));
}

/** @param {Range} range @param {number} place */
export function valueAt(range, place) {
  const { low, high, scale } = range;
  if (scale === "log") return allowed(range, low * (high / low) ** place);
  if (scale === "log_from_zero") return allowed(range, low + Math.expm1(place * Math.log1p(high - low)));
  return allowed(range, low + place * (high - low));
}

/** @param {Range} range @param {number} value */
export function placeOf({ low, high, scale }, value) {
  const clamped = Math.max(low, Math.min(high, value));
  if (scale === "log") return Math.log(clamped / low) / Math.log(high / low);
  if (scale === "log_from_zero") return Math.log1p(clamped - low) / Math.log1p(high - low);
  return (clamped - low) / (high - low);
}

/** The value some arrow keys away; a whole number always changes by at least 1.
 * @param {Range} range @param {number} value @param {number} steps signed @param {boolean} fine */
export function stepped(range, value, steps, fine) {
  const to = valueAt(range, placeOf(range, value) + steps * (fine ? FINE_STEP : STEP));
  if (!range.whole) return to;
  const least = fine ? steps : Math.sign(steps) * Math.max(Math.abs(steps), Math.abs(to - value));
  return allowed(range, value + least);
}

/** The range of a quality setting, of which only the bounds are known: wide ones get a logarithmic track.
 * @param {number} low @param {number} high @returns {Range} */
export function rangeOfBounds(low, high) {
  // A choice: beyond a factor of 50 the lower values crowd on a linear track.
  const wide = high - low > 50 * Math.max(1, low);
  return {
    low,
    high,
    scale: !wide ? "linear" : low > 0 ? "log" : "log_from_zero",
    whole: Number.isInteger(low) && Number.isInteger(high),
  };
}

/** A number with at most `digits` significant digits, without trailing zeros.
 * @param {number} value @param {number} [digits] */
export function formatted(value, digits = DIGITS) {
  if (value === 0 || !Number.isFinite(value)) return String(value || 0);
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-5) return value.toExponential(2);
  if (size >= 10 ** digits) return String(Math.round(value));
  return String(Number(value.toPrecision(digits)));
}

/** The number that someone typed, with a comma or a point; null where it is none. @param {string} text */
export function typedNumber(text) {
  const cleaned = text.trim().replace(",", ".").replace("−", "-");
  const value = Number(cleaned);
  return cleaned !== "" && Number.isFinite(value) ? value : null;
}
