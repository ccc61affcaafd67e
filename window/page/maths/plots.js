/**
 * Geometry of the small plots: the loss of a fit and the bar of passes.
 */

/** A loss curve on a logarithmic axis as the points of an SVG polyline; "" without a positive loss.
 * @param {number[]} losses @param {number} width @param {number} height */
export function lossPoints(losses, width, height) {
  const logs = losses.map((loss) => (loss > 0 ? Math.log(loss) : NaN));
  const known = logs.filter(Number.isFinite);
  if (!known.length) return "";
  const [low, high] = [Math.min(...known), Math.max(...known)];
  const span = high - low || 1;
  return logs
    .map((log, index) => [
      losses.length > 1 ? (index / (losses.length - 1)) * width : 0,
      high === low ? height / 2 : height - ((log - low) / span) * height,
    ])
    .filter(([, y]) => Number.isFinite(y))
    .map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`)
    .join(" ");
}

/** Shares of the bar for each pass, and where the budget stands on it.
 * @param {[string, number][]} passes @param {number | null} budget milliseconds
 * @returns {{parts: {name: string, milliseconds: number, from: number, share: number}[], total: number,
 *   budget: number | null}} `from`, `share` and `budget` in [0, 1] of the bar */
export function passBar(passes, budget) {
  const total = passes.reduce((sum, [, milliseconds]) => sum + milliseconds, 0);
  // A budget that is larger than the frame leaves the bar short of its end, with room for the line.
  const whole = Math.max(total, budget ? 1.05 * budget : 0) || 1;
  let from = 0;
  const parts = passes.map(([name, milliseconds]) => {
    const part = { name, milliseconds, from: from / whole, share: milliseconds / whole };
    from += milliseconds;
    return part;
  });
  return { parts, total, budget: budget ? budget / whole : null };
}
