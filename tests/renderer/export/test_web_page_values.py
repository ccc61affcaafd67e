"""What the exported page copies and saves, in a real browser, read by the commands that it is for."""

import dataclasses
import json

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS
from exported_frames import CONFIG, SCENES, textured_room, with_parameters, with_resolution
from exported_page import image_of, page_text, web_view
from PIL import Image

from vpltune.cli.program import run
from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.light_settings import LightSettings
from vpltune.renderer.config.tuned_config import FitNote, read_config, write_config
from vpltune.renderer.scene.views import light_to_json, read_views

SMALL = with_resolution(with_parameters(CONFIG, vpl_count=32), 64)
SELECTED = "field => [field.selectionStart, field.selectionEnd, field.value.length]"


def saved(page, button, folder):
    """The file that a button saves when it is pressed by keyboard."""
    page.focus(button)
    with page.expect_download() as download:
        page.keyboard.press("Enter")
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


def test_the_command_draws_from_the_saved_files_what_the_page_shows(opened, tmp_path):
    """To 3/255 in all but 1 % of the pixels, as rasterisers round edges to grids of their own."""
    scene, exported = str(SCENES / "cornell-box.glb"), tmp_path / "exported.json"
    write_config(exported, SMALL)
    made = tmp_path / "made.html"
    export = ["export", str(exported), "--to", "web", "--scene", scene, "--size", "64x48", "-o", str(made)]
    assert run(export) == 0
    page = opened(made.read_text(encoding="utf-8"))
    before = image_of(page)
    for key in ("ArrowLeft", "ArrowUp", "-", "d", "s", "e"):
        page.keyboard.press(key)
    page.locator("#intensity").fill("0.9")
    page.keyboard.press("Tab")
    # The commands measure the exposure anew, which the page does after a reset alone.
    page.evaluate("vpltune.exposure = null; vpltune.change({})")
    shown = image_of(page)
    assert (np.abs(shown - before).max(axis=-1) > 3).mean() > 0.5
    config, views = saved(page, "#save-config", tmp_path), saved(page, "#save-views", tmp_path)
    assert (config.name, views.name) == ("tuned.json", "views.json")
    drawn = tmp_path / "drawn.png"
    given = ["--config", str(config), "--views", str(views), "-o", str(drawn)]
    assert run(["render", scene, *given]) == 0
    with Image.open(drawn) as image:
        difference = np.abs(np.asarray(image.convert("RGB")).astype(int) - shown).max(axis=-1)
    assert (difference > 3).mean() < 0.01, f"by up to {difference.max()}"


def test_an_unchanged_config_is_saved_as_it_was(opened, tmp_path):
    """And its checksum, of every kind of text and of 100 numbers of every size (seed 3)."""
    random = np.random.default_rng(3)
    numbers = (random.choice([-1.0, 1.0], 100) * 10.0 ** random.uniform(-12.0, 15.0, 100)).tolist()
    config = dataclasses.replace(
        SMALL,
        fit=FitNote("improved", "by half"),
        light=LightSettings(bounces=3, sky_lights=16),
        # A lone surrogate is how Python holds a file name that is not Unicode; the emoji sorts after U+FF5E.
        provenance={
            "7": 1,
            "10": 2,
            "\uff5e": 3,
            "\U0001f4a1": 4,
            "é": 'a\x7f\n"\\/\x01',
            "file": "\udcff",
            "__proto__": 5,
            **{f"number {i}": number for i, number in enumerate([*numbers, 1e-4, 9.9e-5, 0.0, -0.0])},
        },
    )
    original = tmp_path / "original.json"
    write_config(original, config)
    page = opened(page_text(textured_room(), web_view("spot", (16, 12)), config))
    path = saved(page, "#save-config", tmp_path)
    assert json.loads(path.read_text(encoding="utf-8")) == json.loads(original.read_text(encoding="utf-8"))
    assert read_config(path) == config


def test_whole_numbers_beyond_doubles_are_rounded_and_the_checksum_is_right(opened, tmp_path):
    """From 2⁵³ on, JavaScript rounds them; only free-form keys have such. To the 2⁻⁵³ of a double."""
    numbers = {"seed": 2**63 + 1, "large": 12345678901234567890, "larger": 10**21 + 1, "largest": 1e30}
    config = dataclasses.replace(SMALL, provenance=numbers)
    page = opened(page_text(textured_room(), web_view("spot", (16, 12)), config))
    assert read_config(saved(page, "#save-config", tmp_path)).provenance == pytest.approx(numbers, rel=2**-53)


@pytest.mark.parametrize(("key", "end"), [("End", "high"), ("Home", "low")])
def test_sliders_at_their_ends_are_within_the_bounds(opened, tmp_path, key, end):
    """And a config that was edited no longer says how a fit ended."""
    config = dataclasses.replace(SMALL, fit=FitNote("improved", "by half"), provenance={"seed": 7})
    page = opened(page_text(textured_room(), web_view("spot", (16, 12)), config))
    names = ("intensity", "falloff_footprint", "extinction_coefficient", "density_exponent")
    for name in names:
        page.focus(f"#{name}")
        page.keyboard.press(key)
    read = read_config(saved(page, "#save-config", tmp_path))
    ends = {name: getattr(parameter_spec(name), end) for name in names}
    # The slider's positions are doubles of the logarithm.
    assert read.parameters.as_dict() == pytest.approx({**SMALL.parameters.as_dict(), **ends}, rel=1e-12)
    assert (read.fit, read.quality) == (None, SMALL.quality)
    assert read.provenance == {"seed": 7, "edited": "in an exported page"}


def test_every_light_is_saved_where_it_stands(opened, tmp_path):
    # The sun's direction has a length of exactly one, so that it stays as it is when it is read.
    sun = dataclasses.replace(ROOM_LIGHTS["directional"], direction_world=np.array([0.0, -0.6, -0.8]))
    lights = tuple((ROOM_LIGHTS | {"directional": sun}).values())
    view = dataclasses.replace(web_view("spot", (16, 12)), lights=lights)
    page = opened(page_text(textured_room(), view, SMALL))
    (untouched,) = read_views(saved(page, "#save-views", tmp_path))
    assert [light_to_json(light) for light in untouched.lights] == [light_to_json(one) for one in view.lights]
    assert untouched.size == view.size
    np.testing.assert_array_equal(untouched.camera.to_world, view.camera.to_world)
    # tan and its inverse, in doubles.
    assert untouched.camera.yfov == pytest.approx(view.camera.yfov, rel=1e-14)
    page.click("text=3: point")
    page.keyboard.press("d")
    page.keyboard.press("ArrowLeft")
    (moved,) = read_views(saved(page, "#save-views", tmp_path))
    shifts = [
        np.linalg.norm(a.position_world - b.position_world)
        for a, b in zip(moved.lights, view.lights, strict=True)
    ]
    # A key moves by 0.02 diagonals of a room of 2 × 2 × 2.
    assert shifts == pytest.approx([0.0, 0.0, 0.02 * np.sqrt(12.0), 0.0], abs=1e-6)
    np.testing.assert_array_equal(moved.camera.to_world, page.evaluate("vpltune.camera"))


def test_copy_puts_parameters_and_lights_into_the_clipboard(opened):
    view = web_view("spot", (16, 12))
    page = opened(page_text(textured_room(), view, SMALL))
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.click("#copy")
    page.wait_for_function("document.getElementById('values-status').textContent === 'Copied.'")
    copied = json.loads(page.evaluate("navigator.clipboard.readText()"))
    assert ArtistParameters.validated(copied["parameters"]) == SMALL.parameters
    assert copied["lights"] == [light_to_json(light) for light in view.lights]
    page.keyboard.press("d")
    assert page.inner_text("#values-status") == ""


@pytest.mark.parametrize("clipboard", ["denied", "absent"])
def test_without_a_clipboard_the_text_is_selected(opened, clipboard):
    page = opened(page_text(textured_room(), web_view("spot", (16, 12)), SMALL))
    if clipboard == "denied":
        page.context.grant_permissions([])
    else:
        # As in a page that is served by http.
        page.evaluate("Object.defineProperty(navigator, 'clipboard', { value: undefined })")
    page.focus("#copy")
    page.keyboard.press("Space")
    page.wait_for_selector("#values-text", state="visible")
    assert "copy it with Ctrl+C" in page.inner_text("#values-status")
    start, end, length = page.eval_on_selector("#values-text", SELECTED)
    assert (start, end) == (0, length)
    text, lights = page.input_value("#values-text"), page.evaluate("vpltune.lights")
    assert json.loads(text)["lights"] == lights
    # The keys of camera and lights are not for the text.
    page.keyboard.press("d")
    assert page.evaluate("vpltune.lights") == lights
    page.keyboard.press("Control+c")
    page.evaluate("document.body.append(document.createElement('textarea')); document.body.lastChild.focus()")
    page.keyboard.press("Control+v")
    assert page.evaluate("document.body.lastChild.value") == text
    page.focus("#image")
    page.keyboard.press("d")
    assert page.is_hidden("#values-text")


def test_without_sha_256_the_config_has_no_checksum(opened, tmp_path):
    """Browsers give it to pages from files and https alone."""
    page = opened(page_text(textured_room(), web_view("spot", (16, 12)), SMALL))
    page.evaluate("Object.defineProperty(crypto, 'subtle', { value: undefined })")
    path = saved(page, "#save-config", tmp_path)
    assert "checksum" not in json.loads(path.read_text(encoding="utf-8"))
    assert read_config(path) == SMALL


def test_tab_reaches_every_button_and_shows_where_it_is(opened):
    page = opened(page_text(textured_room(), web_view("spot", (16, 12)), SMALL))
    outlines = {}
    for _ in range(20):
        page.keyboard.press("Tab")
        name, style = page.evaluate(
            "[document.activeElement.id, getComputedStyle(document.activeElement).outlineStyle]"
        )
        outlines[name] = style
    reached = {"image", "exposure", "reset", "intensity", "copy", "save-config", "save-views"}
    assert {name: outlines.get(name) for name in reached} == dict.fromkeys(reached, "solid")
