/**
 * The canvas with the images of both panes; b lies right of the split line.
 *
 * @typedef {import("../talk/model.js").Model} Model
 * @typedef {import("../talk/model.js").Shown} Shown
 */
import { byId } from "../controls/elements.js";

export class ImageCanvas {
  /** @param {Model} model @param {import("../talk/looks.js").Looks} looks
   * @param {import("../talk/images.js").Images} images */
  constructor(model, looks, images) {
    this.model = model;
    this.canvas = byId("image", HTMLCanvasElement);
    this.context = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d", { alpha: false }));
    new ResizeObserver(([entry]) => {
      const box = entry.devicePixelContentBoxSize?.[0];
      const [width, height] = box
        ? [box.inlineSize, box.blockSize]
        : [entry.contentRect.width, entry.contentRect.height].map((side) =>
            Math.round(side * devicePixelRatio),
          );
      if (width === looks.size[0] && height === looks.size[1]) return;
      looks.size = [width, height];
      [this.canvas.width, this.canvas.height] = looks.size;
      this.draw();
      looks.input();
    }).observe(this.canvas);
    model.on(["image", "viewing", "scene"], () => {
      this.draw();
      images.acknowledge();
    });
  }

  draw() {
    const { shown, viewing } = this.model;
    const { width, height } = this.canvas;
    const line = viewing.b ? Math.round(viewing.split * width) : width;
    this.context.fillStyle = getComputedStyle(this.canvas).backgroundColor;
    this.context.fillRect(0, 0, width, height);
    this.#drawPane(shown.a, 0, line);
    if (viewing.b) this.#drawPane(shown.b, line, width);
  }

  /** Draws an image as high as the canvas, as its field of view is vertical, cut to columns `from` … `to`.
   * @param {Shown | null} shown @param {number} from @param {number} to */
  #drawPane(shown, from, to) {
    if (!shown?.bitmap || to <= from) return;
    const { context, canvas } = this;
    const width = (shown.bitmap.width * canvas.height) / shown.bitmap.height;
    // A size that was rounded for a coarse image leaves no gap at the sides.
    const fitting = Math.abs(width - canvas.width) < canvas.width / 100 ? canvas.width : width;
    context.save();
    context.beginPath();
    context.rect(from, 0, to - from, canvas.height);
    context.clip();
    context.imageSmoothingQuality = "low";
    context.drawImage(shown.bitmap, (canvas.width - fitting) / 2, 0, fitting, canvas.height);
    context.restore();
  }
}
