// --- the page's controls: buttons, sliders, keys and pointer. The last file of the script. -----------------------
// The parameters that have a slider.
const LIVE = ["intensity", "falloff_footprint", "extinction_coefficient", "density_exponent"];

// The state of the page (camera, lights, parameters, exposure) and when to draw.
class Page {
  constructor(frame) {
    this.frame = frame;
    this.surfaces = new Surfaces(frame.scene, EYE_MARGIN * bundle.diagonal);
    this.exposure = null;  // measured once the image is complete
    this.chosenLight = 0;
    this.waiting = [];     // promises to resolve when the image is complete
    this.makeParameters();
    this.makeLights();
    this.listen();
    this.reset();
  }

  // The exported camera, lights and parameters.
  reset() {
    this.orbit = new OrbitCamera(this.surfaces, bundle.view.camera_to_world);
    this.lights = clone(bundle.lights);
    this.faces = clone(bundle.rsm.faces);
    element("exposure").value = 0;
    this.showExposure();
    this.exposure = null;
    this.choose(tunedParameters, "tuned");
  }

  // From camera to world, rigid.
  get camera() {
    return this.orbit.to_world;
  }

  // Use a set of parameters, with the export's VPL count, so that tuned and default cost the same.
  choose(parameters, name) {
    this.parameters = { ...parameters, vpl_count: bundle.config.parameters.vpl_count };
    for (const id of ["tuned", "default"]) element(id).setAttribute("aria-pressed", String(id === name));
    for (const key of LIVE) this.showParameter(key);
    this.change({ light: true });
  }

  // Schedule a new image. `light`: VPLs must be drawn again; `camera`: the view has changed; neither: only parameters.
  change({ light = false, camera = false }) {
    this.lightChanged = this.lightChanged || light;
    this.cameraChanged = this.cameraChanged || camera || light;
    this.gathered = 0;
    // What was copied or shown is no longer how things are.
    element("values-text").hidden = true;
    element("values-status").textContent = "";
    if (!this.asked) this.asked = requestAnimationFrame(() => this.step());
  }

  // One animation frame: bring everything up to date, gather one batch of VPLs, show the image.
  step() {
    this.asked = 0;
    const { vpl_count, density_importance } = this.parameters;
    if (this.lightChanged) this.frame.drawLights(this);
    if (this.cameraChanged) this.frame.drawCamera(this.camera);
    if (this.lightChanged || (this.cameraChanged && density_importance > 0)) this.frame.drawVpls(this, this.parameters);
    this.lightChanged = this.cameraChanged = false;
    if (this.gathered < vpl_count) {
      const end = Math.min(this.gathered + BATCH, vpl_count);
      this.frame.gather(this.camera, this.parameters, this.gathered, end);
      this.gathered = end;
    }
    // Every prefix of the point table is evenly spread: the VPLs gathered so far, scaled up, stand for all.
    this.frame.resolve(vpl_count / this.gathered);
    const finished = this.gathered === vpl_count;
    if (this.exposure === null && finished) this.exposure = this.frame.measuredExposure();
    this.frame.show((this.exposure ?? this.frame.measuredExposure()) * 2 ** element("exposure").valueAsNumber);
    element("status").textContent = `${bundle.view.size.join(" × ")} pixels, ${this.gathered} of ${vpl_count} VPLs`;
    if (!finished) this.asked = requestAnimationFrame(() => this.step());
    else this.waiting.splice(0).forEach((resolve) => resolve());
  }

  // A promise that resolves when the image is complete.
  finished() {
    return this.asked ? new Promise((resolve) => this.waiting.push(resolve)) : Promise.resolve();
  }

  // Turn the camera about its pivot [radians].
  turn(yaw, pitch) {
    this.orbit.turnBy(yaw, pitch);
    this.change({ camera: true });
  }

  // Multiply the camera's distance from its pivot.
  approach(factor) {
    this.orbit.approach(factor);
    this.change({ camera: true });
  }

  // Move the chosen light along the camera's right, up and backward axes, in units of the scene's diagonal.
  moveLight(right, up, backward) {
    let by = [0, 0, 0];
    [right, up, backward].forEach((amount, i) => { by = add(by, column(this.camera, i), amount); });
    moveLight(this, this.chosenLight, this.lights[this.chosenLight].type === "directional" ? [right, up, backward] : by);
    this.showLight();
    this.change({ light: true });
  }

  // One slider for each live parameter.
  makeParameters() {
    for (const spec of bundle.table.filter((row) => LIVE.includes(row.name))) {
      const label = document.createElement("label");
      label.htmlFor = spec.name;
      label.title = spec.meaning;
      label.append(`${spec.symbol} ${spec.name.replaceAll("_", " ")}`);
      const output = document.createElement("output");
      output.id = `${spec.name}-value`;
      label.append(output);
      const slider = document.createElement("input");
      const onScale = spec.scale === "log" ? Math.log : (value) => value;
      Object.assign(slider, { type: "range", id: spec.name, min: onScale(spec.low), max: onScale(spec.high), step: "any" });
      slider.addEventListener("input", () => {
        const value = spec.scale === "log" ? Math.exp(slider.valueAsNumber) : slider.valueAsNumber;
        // Rounding may step over a bound, and readers of configs are strict.
        this.parameters[spec.name] = Math.min(Math.max(value, spec.low), spec.high);
        output.textContent = this.parameters[spec.name].toPrecision(3);
        for (const id of ["tuned", "default"]) element(id).setAttribute("aria-pressed", "false");
        this.change({ light: spec.name === "density_exponent" });
      });
      element("parameters").append(label, slider);
    }
  }

  showParameter(name) {
    const spec = bundle.table.find((row) => row.name === name);
    const value = this.parameters[name];
    element(name).value = spec.scale === "log" ? Math.log(value) : value;
    element(`${name}-value`).textContent = `${value.toPrecision(3)} ${spec.unit === "1" ? "" : spec.unit}`;
  }

  // One button for each light.
  makeLights() {
    this.lights = clone(bundle.lights);
    bundle.lights.forEach((light, i) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `${i + 1}: ${light.type}`;
      button.addEventListener("click", () => { this.chosenLight = i; this.showLight(); });
      element("lights").append(button);
    });
    this.showLight();
  }

  showLight() {
    [...element("lights").children].forEach((button, i) => {
      button.setAttribute("aria-pressed", String(i === this.chosenLight));
    });
    const light = this.lights[this.chosenLight];
    const [word, vector] = light.type === "directional" ? ["along", light.direction] : ["at", light.position];
    element("light-place").textContent = `${word} ${vector.map((value) => value.toPrecision(3)).join(", ")}`;
  }

  showExposure() {
    const stops = element("exposure").valueAsNumber;
    element("exposure-value").textContent = `${stops > 0 ? "+" : ""}${stops.toFixed(1)} stops`;
  }

  listen() {
    const exposure = element("exposure");
    const expose = () => {
      this.showExposure();
      if (!this.asked) this.asked = requestAnimationFrame(() => this.step());
    };
    exposure.addEventListener("input", expose);
    const tuned = () => this.choose(tunedParameters, "tuned");
    const plain = () => this.choose(Object.fromEntries(bundle.table.map((row) => [row.name, row.default])), "default");
    element("tuned").addEventListener("click", tuned);
    element("default").addEventListener("click", plain);
    element("reset").addEventListener("click", () => this.reset());
    element("copy").addEventListener("click", async () => {
      const { parameters, lights } = this;
      element("values-status").textContent = await copy(jsonText({ parameters, lights }));
    });
    element("save-config").addEventListener("click", async () => save("tuned.json", await tunedConfig(this.parameters)));
    element("save-views").addEventListener("click", () => save("views.json", viewsFile(this.camera, this.lights)));
    const brighten = (stops) => { exposure.value = exposure.valueAsNumber + stops; expose(); };
    const keys = {
      ArrowLeft: () => this.turn(-0.05, 0), ArrowRight: () => this.turn(0.05, 0),
      ArrowUp: () => this.turn(0, -0.05), ArrowDown: () => this.turn(0, 0.05),
      "+": () => this.approach(0.93), "=": () => this.approach(0.93), "-": () => this.approach(1.07),
      a: () => this.moveLight(-0.02, 0, 0), d: () => this.moveLight(0.02, 0, 0),
      w: () => this.moveLight(0, 0.02, 0), s: () => this.moveLight(0, -0.02, 0),
      q: () => this.moveLight(0, 0, 0.02), e: () => this.moveLight(0, 0, -0.02),
      "[": () => brighten(-0.2), "]": () => brighten(0.2), r: () => this.reset(),
      t: () => (element("tuned").getAttribute("aria-pressed") === "true" ? plain() : tuned()),
    };
    document.addEventListener("keydown", (event) => {
      const action = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      // A focused slider or text uses the arrow keys itself.
      const field = ["INPUT", "TEXTAREA"].includes(event.target.tagName);
      if (!action || event.ctrlKey || event.metaKey || event.altKey || field) return;
      event.preventDefault();
      action();
    });
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!canvas.hasPointerCapture(event.pointerId)) return;
      const [x, y] = [event.movementX / canvas.clientWidth, event.movementY / canvas.clientHeight];
      if (event.shiftKey) this.moveLight(x, -y, 0);
      else this.turn(-4 * x, -3 * y);
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.approach(1.001 ** event.deltaY);
    }, { passive: false });
  }
}

// The texts that come from the bundle: names may hold any characters and are never parsed as HTML.
function describe() {
  element("name").textContent = bundle.scene;
  element("note").textContent = bundle.note;
  const { visibility, fit, provenance } = bundle.config;
  const ended = fit ? { status: fit.status, ...(fit.sentence && { fit: fit.sentence }) } : {};
  const rows = { visibility, ...tunedParameters, ...ended, ...provenance };
  for (const [name, value] of Object.entries(rows)) {
    const [term, text] = [document.createElement("dt"), document.createElement("dd")];
    term.textContent = name.replaceAll("_", " ");
    text.textContent = String(value);
    element("provenance").append(term, text);
  }
}

async function start() {
  describe();
  if (!gl) throw new Error("this browser has no WebGL 2");
  if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("this graphics driver cannot draw into float textures");
  const frame = new Frame(makeScene(await binaryBytes()));
  window.vpltune = new Page(frame);
  await window.vpltune.finished();
}

window.started = start().catch((error) => {
  element("status").textContent = `Cannot draw: ${error.message}`;
  throw error;
});
