/**
 * Joins the parts of the window.
 */
import { byId, setAttribute, setText } from "./controls/elements.js";
import { keptView } from "./kept_view.js";
import { animationBar } from "./panels/animation_bar.js";
import { CompareBar } from "./panels/compare_bar.js";
import { fileMenu } from "./panels/file_menu.js";
import { panelLayout } from "./panels/layout.js";
import { LightFields } from "./panels/light_fields.js";
import { LightList } from "./panels/light_list.js";
import { parameterRows } from "./panels/parameter_rows.js";
import { passTimes } from "./panels/pass_times.js";
import { qualityRows } from "./panels/quality_rows.js";
import { toast } from "./panels/toasts.js";
import { tunePanel } from "./panels/tune_panel.js";
import { viewList } from "./panels/view_list.js";
import { digitOf, plain, shortcutKeys, toggleHelp, withCommand } from "./shortcuts.js";
import { CameraMoves } from "./stage/camera_moves.js";
import { Flight } from "./stage/flight.js";
import { ImageCanvas } from "./stage/image_canvas.js";
import { LightDrags } from "./stage/light_drags.js";
import { lightMarkers } from "./stage/light_markers.js";
import { Navigation } from "./stage/navigation.js";
import { paneLabels } from "./stage/pane_labels.js";
import { splitLine } from "./stage/split_line.js";
import { Connection } from "./talk/connection.js";
import { Edits } from "./talk/edits.js";
import { Images } from "./talk/images.js";
import { Looks } from "./talk/looks.js";
import { Model } from "./talk/model.js";
import { Picks } from "./talk/picks.js";
import { SOURCES } from "./types.js";

const model = new Model();
const connection = new Connection({
  message: (message) => receivers[message.type]?.(message),
  image: (bytes) =>
    images.receive(bytes).catch((error) => toast("error", `an image could not be shown: ${error.message}`)),
  opened: (open) => {
    const lost = model.connected && !open;
    model.connected = open;
    byId("lost", HTMLElement).hidden = open;
    if (lost) {
      picks.clear();
      images.forget();
      model.pending.clear();
    }
    model.changed("connection", "image");
  },
});
const looks = new Looks(model, connection);
const edits = new Edits(model, connection, looks);
const images = new Images(model, connection);
const picks = new Picks(model, connection);
const kept = keptView(model);

/** What each message of the server does. @type {Record<string, (message: any) => void>} */
const receivers = {
  scene: (scene) => {
    model.scene = scene;
    if (kept.begin()) {
      model.timings = null;
      moves.pivot = null;
    }
    setText(byId("renderer", HTMLElement), scene.renderer);
    model.changed("scene", "viewing", "timings");
    looks.send();
  },
  state: (state) => {
    model.state = state;
    edits.received();
    // A source that is gone makes room for the one by hand.
    if (model.missing(model.viewing.a)) model.viewing.a = "hand";
    if (model.viewing.b && model.missing(model.viewing.b)) model.viewing.b = null;
    if (model.missing(model.viewing.errorOf)) model.viewing.errorOf = "hand";
    model.changed("state", "viewing");
  },
  picked: (picked) => picks.answered(picked),
  timings: (timings) => {
    model.timings = timings;
    model.changed("timings");
  },
  notice: ({ level, text }) => toast(level, text),
};

const moves = new CameraMoves(model, looks);
const flight = new Flight(model, moves);
const navigation = new Navigation(model, moves, picks, flight);
const lights = new LightList(model, edits, moves);
const drags = new LightDrags(model, edits);
const compare = new CompareBar(model, looks);
new ImageCanvas(model, looks, images);
new LightFields(model, edits);
splitLine(model);
paneLabels(model);
lightMarkers(model, (index) => lights.select(index));
parameterRows(model, edits);
qualityRows(model, edits);
viewList(model, connection, moves);
const measure = passTimes(model, looks, connection);
const tune = tunePanel(model, connection);
const play = animationBar(model, looks);
const save = fileMenu(model, edits, connection);
const togglePanel = panelLayout();

/** Waits for a click on a surface to put the selected light there, or no longer. @param {boolean} on */
function placing(on) {
  if (on && model.selected < 0) return;
  navigation.clickTool = on
    ? (picked) => {
        placing(false);
        if (picked.position) drags.putOn(picked);
        else toast("info", "There is no surface there");
      }
    : null;
  byId("stage", HTMLElement).classList.toggle("placing", on);
  byId("placing", HTMLElement).hidden = !on;
  setAttribute(byId("move-light", HTMLElement), "aria-pressed", String(on));
}
byId("move-light", HTMLElement).addEventListener("click", () => placing(!navigation.clickTool));
byId("show-help", HTMLElement).addEventListener("click", toggleHelp);

const onStage = () => document.activeElement === byId("stage") || document.activeElement === document.body;

shortcutKeys(
  [
    { group: "Camera", keys: "drag", does: "orbit about the surface under the pointer" },
    { group: "Camera", keys: "shift + drag", does: "pan; so does the middle button" },
    { group: "Camera", keys: "wheel", does: "towards the surface under the pointer" },
    { group: "Camera", keys: "right-button + W A S D Q E", does: "fly; wheel: speed" },
    {
      group: "Camera",
      keys: "← → ↑ ↓",
      does: "orbit",
      match: (event) => onStage() && event.key.startsWith("Arrow") && !event.ctrlKey && !event.altKey,
      run: (event) => moves.key(event.key),
    },
    { group: "Camera", keys: "F", does: "show the whole scene", match: plain("f"), run: () => moves.frame() },
    {
      group: "Camera",
      keys: "Home",
      does: "back to the start",
      match: plain("home"),
      run: () => moves.home(),
    },
    {
      group: "Camera",
      keys: "K",
      does: "keep this view",
      match: plain("k"),
      run: () => byId("view-name", HTMLElement).focus(),
    },
    {
      group: "Compare",
      keys: "1 … 7",
      does: "this source in the left pane",
      match: (event) => digitOf(event) > 0 && !event.shiftKey,
      run: (event) => compare.show("a", SOURCES[digitOf(event) - 1]),
    },
    {
      group: "Compare",
      keys: "shift + 1 … 7",
      does: "in the right pane",
      match: (event) => digitOf(event) > 0 && event.shiftKey,
      run: (event) => compare.show("b", SOURCES[digitOf(event) - 1]),
    },
    {
      group: "Compare",
      keys: "0",
      does: "no split",
      match: (event) => digitOf(event) === 0,
      run: () => compare.show("b", null),
    },
    {
      group: "Compare",
      keys: "X",
      does: "swap left and right",
      match: plain("x"),
      run: () => compare.swap(),
    },
    { group: "Compare", keys: "L", does: "next layer", match: plain("l"), run: () => compare.nextLayer() },
    {
      group: "Lights",
      keys: "G",
      does: "put the selected light on a surface: then click it",
      match: plain("g"),
      run: () => placing(!navigation.clickTool),
    },
    {
      group: "Lights",
      keys: "shift + D",
      does: "duplicate the selected light",
      match: (event) => plain("d")(event) && event.shiftKey,
      run: () => lights.duplicate(),
    },
    {
      group: "Lights",
      keys: "Delete",
      does: "remove the selected light",
      match: plain("delete"),
      run: () => lights.remove(),
    },
    {
      group: "Lights",
      keys: "Escape",
      does: "cancel; select none",
      match: plain("escape"),
      run: () => (navigation.clickTool ? placing(false) : lights.select(-1)),
    },
    { group: "Values", keys: "← →", does: "on a slider: a step; with shift: finer" },
    { group: "Values", keys: "double-click", does: "back to the default" },
    { group: "Values", keys: "↑ ↓", does: "in a number: a step; drag its name for more" },
    { group: "Window", keys: "T", does: "tune, or stop", match: plain("t"), run: () => tune() },
    { group: "Window", keys: "M", does: "measure the passes", match: plain("m"), run: () => measure() },
    { group: "Window", keys: "space", does: "play, or stop", match: plain(" "), run: () => play() },
    {
      group: "Window",
      keys: "N",
      does: "show or hide the panel",
      match: plain("n"),
      run: () => togglePanel(),
    },
    {
      group: "Window",
      keys: "Ctrl + Z",
      does: "undo",
      match: withCommand("z"),
      run: () => edits.history("undo"),
    },
    {
      group: "Window",
      keys: "Ctrl + Y",
      does: "redo; so does Ctrl + shift + Z",
      match: (event) => withCommand("y")(event) || withCommand("z", true)(event),
      run: () => edits.history("redo"),
    },
    {
      group: "Window",
      keys: "Ctrl + S",
      does: "save the config",
      match: withCommand("s"),
      run: () => save("config"),
    },
    { group: "Window", keys: "?", does: "these keys", match: plain("?"), run: toggleHelp },
  ],
  flight,
);

connection.open();
