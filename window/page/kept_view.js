/**
 * Keeps in the browser's tab what was looked at in each scene, so that a reload comes back to it.
 *
 * @typedef {import("./talk/model.js").Model} Model
 */

/** Milliseconds between two writes: a drag changes the camera in every frame. */
const WRITE_AFTER = 300;

/** @param {Model} model */
export function keptView(model) {
  let path = "";
  let timer = 0;
  const write = () => sessionStorage.setItem(`vpltune view ${path}`, JSON.stringify(model.viewing));
  model.on(["viewing"], () => {
    if (!path || timer) return;
    timer = setTimeout(() => {
      timer = 0;
      write();
    }, WRITE_AFTER);
  });
  addEventListener("pagehide", () => path && write());
  return {
    /** Takes up what was looked at in the scene that has just arrived, or its start. @returns {boolean} whether
     * it is another scene than before */
    begin() {
      const { scene, viewing } = model;
      if (!scene) return false;
      const another = scene.path !== path;
      path = scene.path;
      if (another) {
        viewing.camera = scene.camera;
        viewing.seconds = null;
        Object.assign(viewing, JSON.parse(sessionStorage.getItem(`vpltune view ${path}`) ?? "{}"));
      }
      if (!scene.layers.includes(viewing.layer)) viewing.layer = scene.layers[0] ?? "";
      if (viewing.seconds !== null && !(scene.seconds >= viewing.seconds)) viewing.seconds = null;
      return another;
    },
  };
}
