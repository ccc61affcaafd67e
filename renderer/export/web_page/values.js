// --- what can be copied and saved: parameters, camera and lights as they are. Follows page.js in one script. ------
// A number as Python reads it from JSON text and writes it anew for the checksum: whole ones without a fraction, others
// by `repr`. Whole numbers from 2⁵³ on, which only free-form keys have, were rounded when the page was read.
function canonicalNumber(value) {
  if (Number.isInteger(value)) return Math.abs(value) < 1e21 ? String(value) : BigInt(value).toString();
  return Math.abs(value) < 1e-4 ? value.toExponential().replace(/e-(\d)$/, "e-0$1") : String(value);
}

// Python sorts texts by code points, JavaScript by UTF-16 units.
function byCodePoints(a, b) {
  const [left, right] = [a, b].map((text) => Array.from(text, (character) => character.codePointAt(0)));
  const i = left.findIndex((point, at) => point !== right[at]);
  return i < 0 ? left.length - right.length : left[i] - (right[i] ?? -1);
}

// The text that a config's checksum is taken of: sorted keys, no blanks, ASCII (renderer/config/tuned_config.py).
function canonicalText(value) {
  if (typeof value === "number") return canonicalNumber(value);
  if (typeof value === "string") {
    const escaped = (unit) => `\\u${unit.charCodeAt(0).toString(16).padStart(4, "0")}`;
    return JSON.stringify(value).replace(/[\u007f-\uffff]/g, escaped);
  }
  if (Array.isArray(value)) return `[${value.map(canonicalText).join(",")}]`;
  if (value === null || typeof value !== "object") return String(value);
  const members = Object.keys(value).sort(byCodePoints).map((key) => `${canonicalText(key)}:${canonicalText(value[key])}`);
  return `{${members.join(",")}}`;
}

// The config file of the present parameters. Where they are not the exported ones, it says so, and not how a fit ended.
async function tunedConfig(present) {
  const { lloyd_iterations, ...parameters } = present;
  const { checksum, fit, provenance, ...rest } = bundle.config;
  const edited = Object.keys(tunedParameters).some((name) => present[name] !== tunedParameters[name]);
  const config = { ...rest, quality: { ...rest.quality, lloyd_iterations }, parameters };
  if (edited) config.provenance = { ...provenance, edited: "in an exported page" };
  else Object.assign(config, fit && { fit }, provenance && { provenance });
  // Browsers have SHA-256 for pages from files and from https. The checksum is optional.
  if (crypto.subtle) {
    const digest = await crypto.subtle.digest("SHA-256", new TextEncoder().encode(canonicalText(config)));
    const bytes = Array.from(new Uint8Array(digest), (byte) => byte.toString(16).padStart(2, "0"));
    config.checksum = `sha256:${bytes.join("")}`;
  }
  return config;
}

// The views file of the present camera and lights.
function viewsFile(camera, lights) {
  const { size, tan_half_fov } = bundle.view;
  const placed = { to_world: camera.flat(), yfov: 2 * Math.atan(tan_half_fov[1]) };
  return { scene: bundle.scene, views: [{ name: "page", split: "fitted", size, camera: placed, lights }] };
}

const jsonText = (value) => `${JSON.stringify(value, null, 2)}\n`;

// Hand a file to the browser, which saves it or asks where.
function save(name, value) {
  const link = document.createElement("a");
  link.download = name;
  link.href = `data:application/json,${encodeURIComponent(jsonText(value))}`;
  link.click();
}

// Put a text into the clipboard; where the browser denies it, show the text, selected.
async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    return "Copied.";
  } catch {
    const field = element("values-text");
    field.value = text;
    field.hidden = false;
    field.focus();
    field.select();
    field.scrollTop = 0;
    return "The browser denies the clipboard. The text is selected: copy it with Ctrl+C or ⌘C.";
  }
}
