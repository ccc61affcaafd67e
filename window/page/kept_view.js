/**
 * Keeps in the browser's tab what was looked at in each scene, so that a reload comes back to it.
 *
 * @typedef {import("./talk/model.js").Model} Model
 */

/** Milliseconds between two writes: a drag changes the camera in every frame. */
const WRITE_AFTER = 300;

/** @param {Model} model */
export function keptView(model) {
  /** @type {string | null} */
  let key = null;
  let timer = 0;
  const write = () => sessionStorage.setItem(`vpltune view ${key}`, JSON.stringify(model.viewing));
  model.on(["viewing"], () => {
    if (key === null || timer) return;
    timer = setTimeout(() => {
      timer = 0;
      write();
    }, WRITE_AFTER);
  });
  addEventListener("pagehide", () => key !== null && write());
  return {
    /** Takes up what was looked at in the scene that has just arrived, or its start.
     * @returns {boolean} whether
     * it is another scene than before */
    begin() {
      const { scene, viewing } = model;
      if (!scene) return false;
      // A scene in memory has no path.
      const next = scene.path ?? scene.name;
      const another = next !== key;
      key = next;
      if (another) {
        viewing.camera = scene.camera;
        viewing.seconds = null;
        Object.assign(viewing, JSON.parse(sessionStorage.getItem(`vpltune view ${key}`) ?? "{}"));
      }
      if (!scene.layers.includes(viewing.layer)) viewing.layer = scene.layers[0] ?? "";
      if (viewing.seconds !== null && !(scene.seconds >= viewing.seconds)) viewing.seconds = null;
      return another;
    },
  };
}
