"use strict";
// The renderer of the exported page, in WebGL 2. It draws what the runtime draws: G-buffer, RSM, VPLs, gather, direct
// light, tone curve. Reads three elements of the page: `bundle` (the document), `binary` (its arrays) and `shaders`
// (sources from shaders/web/). Owner: web_page.py, which joins the files of one page.
//
// VPLs are drawn again only when a light moves, or, with VPL importance, when the camera moves. Each animation frame
// gathers one batch of VPLs, so that the page stays responsive on a slow machine.

const bundle = JSON.parse(document.getElementById("bundle").textContent);
const shaders = JSON.parse(document.getElementById("shaders").textContent);
// A config file keeps the number of Lloyd iterations with its quality settings.
const { lloyd_iterations } = bundle.config.quality;
const tunedParameters = { ...bundle.config.parameters, lloyd_iterations };
const element = (id) => document.getElementById(id);
const BATCH = 32;  // VPLs gathered in one animation frame; a choice
const FULLSCREEN = "web/fullscreen.vert";

async function binaryBytes() {
  const text = atob(document.getElementById("binary").textContent.trim());
  const packed = Uint8Array.from(text, (character) => character.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// --- vectors and matrices; a matrix is an array of its rows -------------------------------------------------------
const add = (a, b, scale = 1) => a.map((value, i) => value + scale * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const normalized = (a) => a.map((value) => value / Math.hypot(...a));
const column = (matrix, i) => [matrix[0][i], matrix[1][i], matrix[2][i]];
const transposed = (matrix) => matrix[0].map((_, i) => matrix.map((row) => row[i]));
const columnMajor = (matrix) => new Float32Array(transposed(matrix).flat());
// The inverse of a rotation with a translation.
function rigidInverse(matrix) {
  const axes = [0, 1, 2].map((i) => column(matrix, i));
  return [...axes.map((axis) => [...axis, -dot(axis, column(matrix, 3))]), [0, 0, 0, 1]];
}
// A vector turned about a unit axis through the origin (Rodrigues' rotation formula).
function rotated(vector, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const along = dot(axis, vector) * (1 - c);
  const across = cross(axis, vector);
  return vector.map((value, i) => value * c + across[i] * s + axis[i] * along);
}
// A rigid matrix turned about an axis through `center`.
function turned(matrix, center, axis, angle) {
  const columns = [0, 1, 2].map((i) => rotated(column(matrix, i), axis, angle));
  columns.push(add(center, rotated(add(column(matrix, 3), center, -1), axis, angle)));
  return [...transposed(columns), [0, 0, 0, 1]];
}

// --- WebGL --------------------------------------------------------------------------------------------------------
const canvas = document.getElementById("image");
[canvas.width, canvas.height] = bundle.view.size;
const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, preserveDrawingBuffer: true });

// A linked program with its uniforms' types and locations; the names are keys of `shaders`.
function makeProgram(vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, name] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, shaders[name]);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(`${name}: ${gl.getShaderInfoLog(shader)}`);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(`${fragment}: ${gl.getProgramInfoLog(program)}`);
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++i) {
    const { name, type } = gl.getActiveUniform(program, i);
    uniforms[name] = { type, place: gl.getUniformLocation(program, name) };
  }
  for (const [name, binding] of [["Lights", 0], ["RsmFaces", 1]]) {
    const block = gl.getUniformBlockIndex(program, name);
    if (block !== gl.INVALID_INDEX) gl.uniformBlockBinding(program, block, binding);
  }
  return { program, uniforms };
}

const SETTERS = {
  [WebGL2RenderingContext.FLOAT]: (place, value) => gl.uniform1f(place, value),
  [WebGL2RenderingContext.INT]: (place, value) => gl.uniform1i(place, value),
  [WebGL2RenderingContext.FLOAT_VEC2]: (place, value) => gl.uniform2fv(place, value),
  [WebGL2RenderingContext.FLOAT_VEC3]: (place, value) => gl.uniform3fv(place, value),
  [WebGL2RenderingContext.INT_VEC2]: (place, value) => gl.uniform2iv(place, value),
  [WebGL2RenderingContext.FLOAT_MAT4]: (place, value) => gl.uniformMatrix4fv(place, false, columnMajor(value)),
};

// Use a program and set its uniforms by name. Each texture gets a texture unit; values without a uniform are skipped.
function use({ program, uniforms }, values) {
  gl.useProgram(program);
  let unit = 0;
  for (const [name, { type, place }] of Object.entries(uniforms)) {
    const value = values[name];
    if (value === undefined) continue;
    if (value instanceof WebGLTexture) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, value);
      gl.uniform1i(place, unit++);
    } else {
      SETTERS[type](place, value);
    }
  }
}

function floatTexture(width, height, format) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl[format], width, height);
  for (const side of ["MIN", "MAG"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${side}_FILTER`], gl.NEAREST);
  return texture;
}

// A framebuffer with one texture for each format, and optionally a depth buffer.
function makeTarget(width, height, formats, withDepth = false) {
  const textures = formats.map((format) => floatTexture(width, height, format));
  const framebuffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  const places = textures.map((_, i) => gl.COLOR_ATTACHMENT0 + i);
  textures.forEach((texture, i) => gl.framebufferTexture2D(gl.FRAMEBUFFER, places[i], gl.TEXTURE_2D, texture, 0));
  if (withDepth) {
    const depth = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT32F, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
  }
  gl.drawBuffers(places);
  if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE) throw new Error("no float render targets");
  return { width, height, textures, framebuffer, withDepth };
}

// Run a fragment shader on every texel of a target, or on the canvas.
function fill(target, program, values) {
  gl.bindFramebuffer(gl.FRAMEBUFFER, target ? target.framebuffer : null);
  gl.viewport(0, 0, target ? target.width : canvas.width, target ? target.height : canvas.height);
  gl.disable(gl.DEPTH_TEST);
  gl.bindVertexArray(null);
  use(program, values);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}

// --- the scene ----------------------------------------------------------------------------------------------------
// Vertex attributes without sharing between triangles, so that each vertex can carry its triangle's plane.
function unshared(values, corners, width) {
  const result = new Float32Array(width * corners.length);
  corners.forEach((vertex, i) => { for (let k = 0; k < width; ++k) result[width * i + k] = values[width * vertex + k]; });
  return result;
}

// The unit normal of each triangle, once for each of its corners.
function planeNormals(positions) {
  const result = new Float32Array(positions.length);
  for (let i = 0; i < positions.length; i += 9) {
    const [a, b, c] = [0, 3, 6].map((at) => Array.from(positions.subarray(i + at, i + at + 3)));
    const across = cross(add(b, a, -1), add(c, a, -1));
    const length = Math.hypot(...across) || 1;
    for (let k = 0; k < 9; ++k) result[i + k] = across[k % 3] / length;
  }
  return result;
}

// Vertex buffers and textures of the scene; `bytes` is the decompressed binary.
function makeScene(bytes) {
  const part = (name) => bytes.subarray(bundle.arrays[name].offset, bundle.arrays[name].offset + bundle.arrays[name].bytes);
  const vertices = gl.createVertexArray();
  gl.bindVertexArray(vertices);
  const corners = new Uint32Array(part("triangles").slice().buffer);
  const attributes = ["positions", "normals", "uv", "base_colors"].map((name) => {
    const width = bundle.arrays[name].shape[1];
    return [unshared(new Float32Array(part(name).slice().buffer), corners, width), width];
  });
  attributes.push([planeNormals(attributes[0][0]), 3]);
  attributes.forEach(([values, width], place) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, width, gl.FLOAT, false, 0, 0);
  });
  gl.bindVertexArray(null);
  const anisotropic = gl.getExtension("EXT_texture_filter_anisotropic");
  const textures = bundle.textures.map((entry) => {
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    // WebGL 2 cannot generate mipmaps for SRGB8, only for SRGB8_ALPHA8: add an alpha of 255.
    const rgba = new Uint8Array(entry.size[0] * entry.size[1] * 4).fill(255);
    for (let i = 0; i < rgba.length / 4; ++i) rgba.set(bytes.subarray(entry.offset + 3 * i, entry.offset + 3 * i + 3), 4 * i);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, ...entry.size, 0, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    ["S", "T"].forEach((side, i) => {
      gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_WRAP_${side}`], entry.repeat[i] ? gl.REPEAT : gl.CLAMP_TO_EDGE);
    });
    if (anisotropic) gl.texParameterf(gl.TEXTURE_2D, anisotropic.TEXTURE_MAX_ANISOTROPY_EXT, 8);
    return texture;
  });
  return { vertices, textures, bytes: part };
}

// Draw all triangles from a camera or light face: `toWorld` is rigid and looks along −Z. Depth is reversed.
function drawScene(scene, program, toWorld, extent, orthographic, values) {
  const [x, y, z, one] = rigidInverse(toWorld);
  const scaled = (row, by) => row.map((value) => value / by);
  const toClip = [scaled(x, extent[0]), scaled(y, extent[1]), [0, 0, 0, 0], orthographic ? one : scaled(z, -1)];
  gl.enable(gl.DEPTH_TEST);
  gl.depthFunc(gl.GREATER);
  gl.bindVertexArray(scene.vertices);
  for (const draw of bundle.draws) {
    const { mirrored } = bundle.textures[draw.texture];
    use(program, { ...values, to_clip: toClip, base_color_texture: scene.textures[draw.texture], mirrored });
    gl.drawArrays(gl.TRIANGLES, 3 * draw.first, 3 * draw.count);
  }
}

// Set all textures and the depth of a target to 0.
function clear(target) {
  gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
  target.textures.forEach((_, i) => gl.clearBufferfv(gl.COLOR, i, [0, 0, 0, 0]));
  gl.clearBufferfv(gl.DEPTH, 0, [0]);
}

// --- lights -------------------------------------------------------------------------------------------------------
const KINDS = { spot: 0, point: 1, directional: 2 };
const center = [0, 1, 2].map((i) => (bundle.bounds[0][i] + bundle.bounds[1][i]) / 2);
const clone = (value) => JSON.parse(JSON.stringify(value));

// The bytes of the uniform blocks `Lights` and `RsmFaces` of shaders/common/lights.glsl (64 and 96 bytes an element).
function lightBlocks(lights, faces) {
  const light = new DataView(new ArrayBuffer(64 * lights.length));
  const face = new DataView(new ArrayBuffer(96 * faces.length));
  const floats = (view, at, values) => values.forEach((value, i) => view.setFloat32(at + 4 * i, value, true));
  lights.forEach((entry, i) => {
    const [inner, outer] = [Math.cos(entry.inner_cone), Math.cos(entry.outer_cone)];
    floats(light, 64 * i, [...entry.position, KINDS[entry.type], ...entry.direction, 1 / Math.max(inner - outer, 1e-6)]);
    floats(light, 64 * i + 32, [...entry.intensity, outer]);
    light.setInt32(64 * i + 48, faces.findIndex((other) => other.light === i), true);
    light.setInt32(64 * i + 52, faces.filter((other) => other.light === i).length, true);
    // Only lights that end have a range.
    light.setFloat32(64 * i + 56, entry.range ? 1 / entry.range : 0, true);
  });
  faces.forEach((entry, i) => {
    floats(face, 96 * i, [...columnMajor(entry.light_to_world), ...entry.extent, entry.near_or_range]);
    face.setInt32(96 * i + 76, entry.light, true);
    face.setInt32(96 * i + 80, entry.orthographic ? 1 : 0, true);
  });
  return [light, face];
}

// Move one light by a vector in units of the scene's diagonal. A directional light turns about the scene's centre.
function moveLight(state, index, by) {
  const light = state.lights[index];
  if (light.type !== "directional") {
    const offset = by.map((value) => value * bundle.diagonal);
    light.position = add(light.position, offset);
    for (const face of state.faces.filter((other) => other.light === index)) {
      offset.forEach((value, i) => { face.light_to_world[i][3] += value; });
    }
    return;
  }
  const sideways = normalized(cross(light.direction, Math.abs(light.direction[1]) < 0.99 ? [0, 1, 0] : [1, 0, 0]));
  const [yaw, pitch] = [3 * by[0] - 3 * by[2], 3 * by[1]];
  light.direction = normalized(rotated(rotated(light.direction, [0, 1, 0], yaw), sideways, pitch));
  for (const face of state.faces.filter((other) => other.light === index)) {
    face.light_to_world = turned(turned(face.light_to_world, center, [0, 1, 0], yaw), center, sideways, pitch);
    // A face that holds the whole scene from every direction: half the diagonal, with 1 % to spare.
    const half = bundle.diagonal * 0.505;
    face.extent = [half, half];
    face.near_or_range = 2 * half;
    add(center, column(face.light_to_world, 2), half).forEach((value, i) => { face.light_to_world[i][3] = value; });
  }
}
