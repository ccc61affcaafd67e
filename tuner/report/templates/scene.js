"use strict";
// Shows linear images under one exposure: half floats → radiance or irradiance → tone curve → canvas.

const VARIANTS = ["reference", "default", "tuned", "ceiling"];
const LUMINANCE = [0.2126, 0.7152, 0.0722];
const one = (selector, within = document) => within.querySelector(selector);
const all = (selector, within = document) => [...within.querySelectorAll(selector)];

// The value of each of the 65,536 half floats (IEC 60559 binary16).
const HALVES = Float32Array.from({ length: 65536 }, (_, bits) => {
  const sign = bits & 0x8000 ? -1 : 1, exponent = (bits >> 10) & 31, mantissa = bits & 1023;
  return sign * (exponent ? 2 ** (exponent - 15) * (1 + mantissa / 1024) : 2 ** -14 * (mantissa / 1024));
});

// Decodes `packed_halves` of view_blocks.py: the low bytes of each channel, then the high bytes. Returns interleaved RGB.
async function unpacked(text) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const count = bytes.length / 2, pixels = count / 3, values = new Float32Array(count);
  for (let i = 0; i < count; i++) values[(i % pixels) * 3 + Math.floor(i / pixels)] = HALVES[bytes[i] | (bytes[count + i] << 8)];
  return values;
}

// Khronos PBR Neutral (2024), in place. Twin of shaders/display/tone_mapping.comp.
function toneCurve(shown) {
  const start = 0.8 - 0.04, desaturation = 0.15;
  const low = Math.min(shown[0], shown[1], shown[2]), offset = low < 0.08 ? low - 6.25 * low * low : 0.04;
  for (let c = 0; c < 3; c++) shown[c] -= offset;
  const peak = Math.max(shown[0], shown[1], shown[2]);
  if (peak < start) return;
  const room = 1 - start, newPeak = 1 - (room * room) / (peak + room - start);
  const towardsWhite = 1 - 1 / (desaturation * (peak - newPeak) + 1);
  for (let c = 0; c < 3; c++) shown[c] = ((shown[c] * newPeak) / peak) * (1 - towardsWhite) + newPeak * towardsWhite;
}

// 8-bit sRGB (IEC 61966-2-1), indexed by the square root of the linear value, which spaces 4,096 entries evenly enough.
const SRGB = Uint8Array.from({ length: 4096 }, (_, index) => {
  const linear = (index / 4095) ** 2;
  return Math.round(255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055));
});
const srgbEncode = (linear) => SRGB[Math.round(4095 * Math.sqrt(Math.min(Math.max(linear, 0), 1)))];

class View {
  constructor(article, linear, near) {
    Object.assign(this, { article, linear, near, planes: {}, radiance: {} });
    this.panes = all("figure[data-variant] img", article).filter((image) => image.closest(".stack")).map((image) => {
      const canvas = document.createElement("canvas");
      canvas.width = linear.width;
      canvas.height = linear.height;
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", image.alt);
      canvas.dataset.variant = image.closest("figure").dataset.variant;
      image.replaceWith(canvas);
      return canvas;
    });
    this.panes.push(one(".truth canvas", article));
    all(".split, .divider, .truth, .hint", article).forEach((element) => (element.hidden = false));
    const split = one(".split", article), stack = one(".stack", article);
    const place = () => {
      stack.style.setProperty("--split", `${split.value}%`);
      split.setAttribute("aria-valuetext", `${split.value} % ${one("#left").value}, the rest ${one("#right").value}`);
    };
    split.addEventListener("input", place);
    place();
    this.watchPointer();
  }

  async load() {
    const names = Object.keys(this.linear.halves);
    const values = await Promise.all(names.map((name) => unpacked(this.linear.halves[name])));
    names.forEach((name, index) => (this.planes[name] = values[index]));
    for (const variant of VARIANTS) {
      const [albedo, direct] = variant === "reference" ? ["reference_albedo", "reference_direct"] : ["albedo", "direct"];
      const indirect = this.planes[`${variant}_indirect`];
      this.radiance[variant] = indirect.map((value, i) => (this.planes[albedo][i] / Math.PI) * (this.planes[direct][i] + value));
    }
  }

  // Draws only canvases near the viewport, so that the exposure slider stays responsive with many views.
  draw(quantity, stops, everything) {
    const state = `${quantity} ${stops}`;
    for (const canvas of this.panes) {
      const wanted = everything || (this.near && canvas.checkVisibility({ visibilityProperty: true }));
      if (!wanted || canvas.dataset.drawn === state) continue;
      this.paint(canvas, quantity, stops);
      canvas.dataset.drawn = state;
    }
  }

  paint(canvas, quantity, stops) {
    const exposure = this.linear.exposures[quantity] * 2 ** stops, shown = new Float64Array(3);
    const variant = canvas.dataset.variant;
    const source = quantity === "image" ? this.radiance[variant] : this.planes[`${variant}_indirect`];
    const image = new ImageData(this.linear.width, this.linear.height);
    for (let i = 0, j = 0; i < source.length; i += 3, j += 4) {
      for (let c = 0; c < 3; c++) shown[c] = source[i + c] * exposure;
      toneCurve(shown);
      for (let c = 0; c < 3; c++) image.data[j + c] = srgbEncode(shown[c]);
      image.data[j + 3] = 255;
    }
    canvas.getContext("2d").putImageData(image, 0, 0);
  }

  // Shows the luminance of the indirect irradiance under the pointer, for every variant.
  watchPointer() {
    const { width, height, level } = this.linear, output = one(".probe output", this.article), hint = one(".hint", this.article);
    const read = (event) => {
      const target = event.target.classList.contains("split") ? one(".stack figure.left canvas", this.article) : event.target;
      if (!target || !target.matches("canvas, .map img") || !this.planes.reference_indirect) return;
      const box = target.getBoundingClientRect();
      const x = Math.floor(((event.clientX - box.left) / box.width) * width), y = Math.floor(((event.clientY - box.top) / box.height) * height);
      if (x < 0 || y < 0 || x >= width || y >= height) return;
      const at = (variant) => LUMINANCE.reduce((sum, weight, c) => sum + weight * this.planes[`${variant}_indirect`][(y * width + x) * 3 + c], 0) * level;
      const reference = at("reference");
      const words = VARIANTS.slice(1).map((variant) => {
        const value = at(variant), percent = Math.round(100 * (value / reference - 1));
        return `${variant} ${value.toPrecision(3)}` + (reference > 0 ? ` (${percent < 0 ? "−" : "+"}${Math.abs(percent)} %)` : "");
      });
      hint.hidden = true;
      output.value = `Pixel ${x}, ${y}: indirect irradiance ${reference.toPrecision(3)} W/m² in the reference, ${words.join(", ")}`;
    };
    this.article.addEventListener("pointermove", read);
  }
}

async function start() {
  const toolbar = one(".toolbar");
  if (!toolbar || typeof DecompressionStream === "undefined") return;
  const linear = JSON.parse(one("#linear").textContent);
  const views = all(".view").map((article, index) => new View(article, linear[index], index === 0));
  const exposure = one("#exposure"), quantity = one("#quantity"), output = one(".exposure output");
  let waiting = false;

  const draw = (everything = false) => {
    waiting = false;
    views.forEach((view) => view.draw(quantity.value, Number(exposure.value), everything === true));
    document.documentElement.dataset.drawn = `${quantity.value} ${exposure.value}`;
  };
  const redraw = () => {
    const stops = Number(exposure.value), sign = stops > 0 ? "+" : stops < 0 ? "−" : "±";
    output.value = `${sign}${Math.abs(stops).toFixed(1)} EV`;
    exposure.setAttribute("aria-valuetext", `${stops.toFixed(1)} stops`);
    if (!waiting) {
      waiting = true;
      requestAnimationFrame(draw);
    }
  };
  const arrange = () => {
    const left = one("#left").value, right = one("#right").value;
    for (const figure of all(".stack figure")) {
      figure.classList.toggle("left", figure.dataset.variant === left);
      figure.classList.toggle("right", figure.dataset.variant === right && left !== right);
    }
    document.documentElement.classList.toggle("slider", one("#layout").value === "slider");
    document.documentElement.classList.toggle("side", one("#layout").value !== "slider");
    document.documentElement.classList.toggle("sharp", one("#sharp").checked);
    all(".split").forEach((split) => split.dispatchEvent(new Event("input")));
    draw();
  };
  const watch = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) views[Number(target.dataset.view)].near = isIntersecting;
    draw();
  }, { rootMargin: "100%" });

  exposure.addEventListener("input", redraw);
  quantity.addEventListener("change", redraw);
  one("#reset").addEventListener("click", () => {
    exposure.value = "0";
    redraw();
  });
  ["#left", "#right", "#layout", "#sharp"].forEach((name) => one(name).addEventListener("change", arrange));
  toolbar.addEventListener("submit", (event) => event.preventDefault());
  await Promise.all(views.map((view) => view.load()));
  toolbar.hidden = false;
  views.forEach((view) => watch.observe(view.article));
  // Printing shows every image, so draw all of them.
  addEventListener("beforeprint", () => draw(true));
  matchMedia("print").addEventListener("change", (change) => change.matches && draw(true));
  arrange();
  redraw();
}

start();
