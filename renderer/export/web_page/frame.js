// --- the page's frame: its passes, in the runtime's order. Follows page.js in one script. --------------------------
// The targets and programs of one frame; `draw…` and `gather` fill them.
class Frame {
  constructor(scene) {
    this.scene = scene;
    const [width, height] = bundle.view.size;
    const [rows, columns] = bundle.rsm.atlas;
    const programs = { geometry: "web/scene.vert", reflective_shadow_map: "web/scene.vert" };
    this.programs = {};
    for (const name of Object.keys(shaders).filter((key) => key.endsWith(".frag"))) {
      const key = name.slice(4, -5);
      this.programs[key] = makeProgram(programs[key] || FULLSCREEN, name);
    }
    this.gbuffer = makeTarget(width, height, ["RG32F", "RGBA16F", "R32F"], true);
    this.rsm = makeTarget(columns, rows, ["RG32F", "RGBA16F", "R32F"], true);
    this.weights = makeTarget(columns, rows, ["R32F", "RGBA32F", "R32F"]);
    this.sums = [0, 1].map(() => makeTarget(columns, rows, ["R32F"]));
    this.totals = [0, 1].map(() => makeTarget(1, rows, ["R32F"]));
    this.moments = [];
    for (let [w, h] = [columns, rows]; w > 1 || h > 1;) {
      [w, h] = [Math.ceil(w / 8), Math.ceil(h / 8)];
      this.moments.push(makeTarget(w, h, ["RGBA32F", "R32F"]));
    }
    const most = bundle.config.parameters.vpl_count;
    const cells = [columns, rows].map((texels) => (texels / bundle.rsm.resolution) * bundle.vpl_importance.cells);
    this.importanceCells = makeTarget(...cells, ["RGBA32F", "RGBA32F"]);
    this.importanceReceivers = makeTarget(bundle.vpl_importance.receivers, 1, ["RGBA32F", "RGBA32F"]);
    [this.importance, this.meanImportance] = [makeTarget(...cells, ["R32F"]), makeTarget(1, 1, ["R32F"])];
    const vplTarget = (count, formats = ["RGBA32F", "RGBA32F", "RGBA32F"]) =>
      makeTarget(bundle.vpl_columns, Math.ceil(count / bundle.vpl_columns), formats);
    this.vpls = vplTarget(most);
    if (this.programs.clustered_discs) {
      const { samples } = bundle.clustered_discs;
      [this.samples, this.owners, this.movedVpls] = [vplTarget(samples), vplTarget(samples, ["R32I"]), vplTarget(most)];
    }
    if (this.programs.vpl_visibility_maps) this.makeVisibility(most);
    this.indirect = [0, 1].map(() => makeTarget(width, height, ["RGBA32F"]));
    this.direct = makeTarget(width, height, ["RGBA32F"]);
    this.radiance = makeTarget(width, height, ["RGBA32F"]);
    const { width: pointColumns, height: pointRows } = this.samples ?? this.vpls;
    this.pointTable = this.makePointTable(pointColumns, pointRows);
    this.blocks = [0, 1].map(() => gl.createBuffer());
  }

  // The R2 sequence of renderer/frame/point_table.py, one point for each texel.
  makePointTable(width, height) {
    const points = new Float32Array(2 * width * height);
    for (let i = 0; i < points.length; ++i) {
      const value = (0.5 + ((i >> 1) + 1) * bundle.point_table.steps[i & 1]) % 1;
      points[i] = Math.min(value, 1 - 2 ** -24);
    }
    const texture = floatTexture(width, height, "RG32F");
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, gl.RG, gl.FLOAT, points);
    return texture;
  }

  // Textures for the tree of boxes over the triangles, and targets for the VPLs' visibility maps.
  makeVisibility(most) {
    const columns = bundle.data_columns;
    this.rays = { longest: bundle.diagonal };
    for (const [name, view, ...format] of [
      ["ray_nodes", Uint32Array, gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT],
      ["ray_triangles", Float32Array, gl.RGBA32F, gl.RGBA, gl.FLOAT],
    ]) {
      const values = new view(this.scene.bytes(name).slice().buffer);
      const height = values.length / 4 / columns;
      this.rays[name] = floatTexture(columns, height, { [gl.RGBA32UI]: "RGBA32UI", [gl.RGBA32F]: "RGBA32F" }[format[0]]);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, columns, height, format[1], format[2], values);
    }
    const texels = most * bundle.visibility_maps.map_size ** 2;
    const rows = Math.ceil(texels / columns);
    [this.castMaps, this.visibility] = [0, 1].map(() => makeTarget(columns, rows, ["RG32UI"]));
    const finer = bundle.visibility_maps.map_refinement;
    if (finer > 1) {
      this.visibilityDetails = makeTarget(columns * finer, rows * finer, ["RG32UI"]);
    }
  }

  // Cast the visibility maps, mark concave corners, and cast finer texels at silhouettes.
  castVisibility(vpl_count) {
    const values = { ...this.rays, ...this.vplValues(this.vpls), ...this.momentSums, vpl_count };
    const { vpl_visibility_maps, vpl_visibility_edges, vpl_visibility_details } = this.programs;
    fill(this.castMaps, vpl_visibility_maps, values);
    fill(this.visibility, vpl_visibility_edges, { ...values, visibility_atlas: this.castMaps.textures[0] });
    if (vpl_visibility_details) {
      fill(this.visibilityDetails, vpl_visibility_details, { ...values, visibility_atlas: this.visibility.textures[0] });
    }
  }

  get rsmValues() {
    const [rsm_normal, rsm_reflectance, rsm_depth] = this.rsm.textures;
    const { resolution, atlas, faces } = bundle.rsm;
    return { rsm_normal, rsm_reflectance, rsm_depth, rsm_columns: atlas[1] / resolution, rsm_face_count: faces.length };
  }

  cameraValues(camera) {
    const { tan_half_fov, near_plane } = bundle.view;
    const [gbuffer_normal, gbuffer_albedo, gbuffer_depth] = this.gbuffer.textures;
    return { gbuffer_normal, gbuffer_albedo, gbuffer_depth, camera_to_world: camera, tan_half_fov, near_plane };
  }

  // Draw the RSM atlas, one face after another.
  drawLights(state) {
    lightBlocks(state.lights, state.faces).forEach((block, i) => {
      gl.bindBuffer(gl.UNIFORM_BUFFER, this.blocks[i]);
      gl.bufferData(gl.UNIFORM_BUFFER, block, gl.DYNAMIC_DRAW);
      gl.bindBufferBase(gl.UNIFORM_BUFFER, i, this.blocks[i]);
    });
    clear(this.rsm);
    const { resolution } = bundle.rsm;
    state.faces.forEach((face, face_index) => {
      gl.viewport(face.origin[1], face.origin[0], resolution, resolution);
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(face.origin[1], face.origin[0], resolution, resolution);
      const { light_to_world, extent, orthographic } = face;
      const values = { face_index, tile_origin: [face.origin[1], face.origin[0]] };
      drawScene(this.scene, this.programs.reflective_shadow_map, light_to_world, extent, orthographic, values);
      gl.disable(gl.SCISSOR_TEST);
    });
  }

  // Draw VPLs from the RSM, weighted by importance for the camera if the config asks for it, and cast their maps.
  drawVpls(state, parameters) {
    if (parameters.density_importance > 0) this.measureImportance(state.camera);
    this.sumWeights(state, parameters);
    const { vpl_count, lloyd_iterations } = parameters;
    this.vplsAreDiscs = Boolean(this.samples) && lloyd_iterations > 0;
    if (this.vplsAreDiscs) this.makeDiscs(parameters);
    else this.placeVpls(this.vpls, parameters, vpl_count);
    if (this.visibility) this.castVisibility(vpl_count);
  }

  // Importance of each cell of the RSM: how much the camera would miss without its light. The share η comes later.
  measureImportance(camera) {
    const { vpl_importance_cells, vpl_importance_receivers, vpl_importance, vpl_importance_mean } = this.programs;
    fill(this.importanceCells, vpl_importance_cells, this.rsmValues);
    const [cell_position_flux, cell_normal_area] = this.importanceCells.textures;
    const cells = { cell_position_flux, cell_normal_area };
    fill(this.importanceReceivers, vpl_importance_receivers, { ...this.cameraValues(camera), ...cells });
    const [receiver_position_valid, receiver_normal_irradiance] = this.importanceReceivers.textures;
    fill(this.importance, vpl_importance, { ...cells, receiver_position_valid, receiver_normal_irradiance });
    fill(this.meanImportance, vpl_importance_mean, { importance: this.importance.textures[0], cell_position_flux });
  }

  weightValues({ density_exponent, density_importance }) {
    const [importance, mean_importance] = [this.importance, this.meanImportance].map((target) => target.textures[0]);
    return { ...this.rsmValues, density_exponent, density_importance, importance, mean_importance };
  }

  // Draw `vpl_count` VPLs into a target; together they carry all the light.
  placeVpls(target, parameters, vpl_count) {
    const sums = { sums_in_rows: this.sumsInRows, sums_of_rows: this.sumsOfRows, rows: bundle.rsm.atlas[0], vpl_count };
    const values = { ...this.weightValues(parameters), ...sums, point_table: this.pointTable };
    fill(target, this.programs.virtual_point_lights, values);
  }

  // Clustered disc lights: draw samples of the RSM, take the first ones as VPLs, and run Lloyd iterations on these.
  makeDiscs(parameters) {
    this.placeVpls(this.samples, parameters, bundle.clustered_discs.samples);
    const [sample_position_footprint, sample_normal_area, sample_flux] = this.samples.textures;
    const samples = { sample_position_footprint, sample_normal_area, sample_flux, sample_rows: this.samples.height };
    const { vpl_count } = parameters;
    let before = this.samples;
    for (let step = 0; step < parameters.lloyd_iterations; ++step) {
      const values = { ...samples, ...this.vplValues(before), ...this.momentSums, vpl_count };
      fill(this.owners, this.programs.clustered_discs_owners, values);
      fill(this.movedVpls, this.programs.clustered_discs, { ...values, vpl_owners: this.owners.textures[0] });
      [this.vpls, this.movedVpls] = [this.movedVpls, this.vpls];
      before = this.vpls;
    }
  }

  vplValues({ textures: [vpl_position_footprint, vpl_normal_area, vpl_flux] }) {
    return { vpl_position_footprint, vpl_normal_area, vpl_flux };
  }

  // Sampling weights, their running sums along rows and over rows, and the moments of the flux.
  sumWeights(state, parameters) {
    const moment_origin = column(state.faces[0].light_to_world, 3);
    fill(this.weights, this.programs.vpl_weights, { ...this.weightValues(parameters), moment_origin });
    const [rows, columns] = bundle.rsm.atlas;
    this.sumsInRows = this.runningSum(this.weights.textures[0], this.sums, columns, [1, 0]);
    fill(this.totals[1], this.programs.running_sum, { values: this.sumsInRows, reach: [0, 0], first: [columns - 1, 0] });
    this.sumsOfRows = this.runningSum(this.totals[1].textures[0], this.totals, rows, [0, 1]);
    let [, flux_position, flux_square] = this.weights.textures;
    for (const target of this.moments) {
      fill(target, this.programs.moment_sums, { flux_position, flux_square });
      [flux_position, flux_square] = target.textures;
    }
    this.momentSums = { flux_position, flux_square };
  }

  // An inclusive scan along an axis, ping-pong between two targets.
  runningSum(values, targets, length, axis) {
    for (let reach = 1, i = 0; reach < length; reach *= 2, i = 1 - i) {
      fill(targets[i], this.programs.running_sum, { values, reach: axis.map((one) => one * reach), first: [0, 0] });
      values = targets[i].textures[0];
    }
    return values;
  }

  // Draw the G-buffer and the direct light.
  drawCamera(camera) {
    clear(this.gbuffer);
    gl.viewport(0, 0, this.gbuffer.width, this.gbuffer.height);
    const values = {
      world_to_camera: rigidInverse(camera), camera_to_world: camera, eye_world: column(camera, 3),
      near_plane: bundle.view.near_plane, tan_half_fov: bundle.view.tan_half_fov, image_size: bundle.view.size,
    };
    drawScene(this.scene, this.programs.geometry, camera, bundle.view.tan_half_fov, false, values);
    fill(this.direct, this.programs.direct_light, { ...this.cameraValues(camera), ...this.rsmValues });
  }

  // Add the light of the VPLs from `first` up to, but not including, `end` to the indirect irradiance.
  gather(camera, parameters, first, end) {
    const [target, earlier] = this.indirect;
    const { vpl_gather, vpl_gather_discs } = this.programs;
    fill(target, this.vplsAreDiscs ? vpl_gather_discs : vpl_gather, {
      ...this.cameraValues(camera), ...parameters, ...this.vplValues(this.vpls), ...this.momentSums,
      first, end, earlier: earlier.textures[0],
      visibility_atlas: this.visibility?.textures[0], visibility_details: this.visibilityDetails?.textures[0],
    });
    this.indirect.reverse();
  }

  // From irradiance to radiance; `indirect_share` scales the indirect light.
  resolve(indirect_share) {
    fill(this.radiance, this.programs.material_resolve, {
      gbuffer_albedo: this.gbuffer.textures[1], direct_irradiance: this.direct.textures[0],
      indirect_irradiance: this.indirect[1].textures[0], indirect_share,
    });
  }

  // The exposure for which the mean luminance of covered pixels is the key (Rec. 709 weights). It reads pixels back,
  // so it is not measured in every frame.
  measuredExposure() {
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.radiance.framebuffer);
    const pixels = new Float32Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.FLOAT, pixels);
    let [luminance, covered] = [0, 0];
    for (let i = 0; i < pixels.length; i += 4) {
      luminance += 0.2126 * pixels[i] + 0.7152 * pixels[i + 1] + 0.0722 * pixels[i + 2];
      covered += pixels[i + 3];
    }
    return luminance > 0 ? (bundle.view.exposure_key * covered) / luminance : 1;
  }

  // Tone-map the radiance onto the canvas.
  show(exposure) {
    fill(null, this.programs.tone_mapping, { radiance: this.radiance.textures[0], exposure });
  }
}
