/**
 * The shapes of what travels between page and server; window/README.md describes them.
 *
 * @typedef {[number, number, number]} Vector
 * @typedef {{to_world: number[], yfov: number}} Camera  16 numbers row by row; radians
 * @typedef {"spot" | "point" | "directional"} LightType
 * @typedef {{name?: string, type: LightType, position: Vector, direction: Vector, intensity: Vector,
 *   inner_cone: number, outer_cone: number, range?: number}} Light
 * @typedef {"default" | "tuned" | "hand" | "auto" | "reference" | "signed_error" | "flip"} Source
 * @typedef {"default" | "tuned" | "hand" | "auto"} ConfigSource
 * @typedef {"a" | "b"} Pane
 * @typedef {{name: string, symbol: string, unit: string, meaning: string, scale: "linear" | "log",
 *   low: number, high: number, default: number, whole_number: boolean, fitted: boolean}} Parameter
 * @typedef {number | string | null} QualityValue
 * @typedef {{name: string, meaning: string, choices?: QualityValue[], low?: number, high?: number}} Quality
 * @typedef {{config: string, sidecar: string, views: string}} Paths
 * @typedef {{name: string, path: string | null, bounds: [Vector, Vector], seconds: number,
 *   parameters: Parameter[], qualities: Quality[], layers: string[], renderer: string,
 *   camera: Camera, tuning: string | null,
 *   paths: Paths}} Scene
 * @typedef {{parameters: Record<string, number>, quality: Record<string, QualityValue>,
 *   intervals: Record<string, [number, number]>, status: string, sentence: string}} Config
 * @typedef {{name: string, split: string, camera: Camera}} KeptView
 * @typedef {{running: boolean, stage: string, share: number, seconds_left: number | null, losses: number[],
 *   parameters: Record<string, number> | null, status: string, sentence: string}} Fit
 * @typedef {{configs: Record<ConfigSource, Config | null>, lights: Light[], views: KeptView[],
 *   unsaved: boolean, unsaved_lights: boolean, unsaved_views: boolean, can_undo: boolean, can_redo: boolean,
 *   undo_name: string | null, redo_name: string | null, budget_ms: number | null, fit: Fit}} State
 * @typedef {{id: number, position: Vector | null, normal: Vector, distance: number}} Picked
 * @typedef {{source: Source, passes: [string, number][], milliseconds: number}} Timings
 * @typedef {{pane: Pane, source: Source, look: number, size: [number, number], settled: boolean,
 *   milliseconds: number, camera: Camera, lights: Light[] | null,
 *   parameters: Record<string, number> | null, share?: number, noise?: number}} ImageHeader
 */

/** Every source, in the order of the number keys. @type {Source[]} */
export const SOURCES = ["default", "tuned", "hand", "auto", "reference", "signed_error", "flip"];

/** What the sources are called. @type {Record<Source, string>} */
export const SOURCE_NAMES = {
  default: "Default",
  tuned: "Tuned",
  hand: "By hand",
  auto: "Auto",
  reference: "Reference",
  signed_error: "Error",
  flip: "FLIP",
};

/** Sources that have a config. @type {ConfigSource[]} */
export const CONFIG_SOURCES = ["default", "tuned", "hand", "auto"];

/** Whether a source is an image of errors. @param {Source | null} source */
export const isError = (source) => source === "signed_error" || source === "flip";

/** Whether a source has a config. @param {string | null} source @returns {source is ConfigSource} */
export const hasConfig = (source) => CONFIG_SOURCES.includes(/** @type {ConfigSource} */ (source));
