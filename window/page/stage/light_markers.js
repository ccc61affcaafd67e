/**
 * A marker over the stage for each light; a click on one selects the light.
 *
 * @typedef {import("../talk/model.js").Model} Model
 */
import { byId, setAttribute, shape } from "../controls/elements.js";
import { colourOf } from "../maths/light_values.js";
import { projected } from "../maths/projection.js";
import { placedLight } from "./light_places.js";

/** Radius of a marker in pixels. */
const RADIUS = 11;

/** @param {Model} model @param {(index: number) => void} select */
export function lightMarkers(model, select) {
  const layer = byId("markers", SVGElement);
  const stage = byId("stage", HTMLElement);
  /** @type {SVGElement[]} */
  const markers = [];

  const make = (/** @type {number} */ index) => {
    const marker = shape(
      "g",
      { class: "marker", "data-marker": index },
      shape("circle", { r: RADIUS, class: "ground" }),
      shape("use", { x: -8, y: -8, width: 16, height: 16 }),
    );
    marker.addEventListener("pointerdown", (event) => {
      if (/** @type {PointerEvent} */ (event).button !== 0) return;
      event.stopPropagation();
      select(index);
    });
    layer.append(marker);
    return marker;
  };

  model.on(["viewing", "image", "state", "selection", "scene"], () => {
    const { clientWidth: width, clientHeight: height } = stage;
    const { lights } = model;
    while (markers.length < lights.length) markers.push(make(markers.length));
    while (markers.length > lights.length) markers.pop()?.remove();
    markers.forEach((marker, index) => {
      const placed = placedLight(model, index, width / height);
      const seen = placed && projected(model.seenCamera, width / height, placed.anchor);
      setAttribute(marker, "visibility", seen ? null : "hidden");
      if (!placed || !seen) return;
      const [x, y] = [seen.place[0] * width, seen.place[1] * height];
      setAttribute(marker, "transform", `translate(${x.toFixed(1)} ${y.toFixed(1)})`);
      marker.classList.toggle("selected", index === model.selected);
      marker.style.setProperty("--light", colourOf(placed.light.intensity).hex);
      setAttribute(/** @type {SVGElement} */ (marker.lastChild), "href", `#icon-${placed.light.type}`);
    });
  });
}
