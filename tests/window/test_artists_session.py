"""A whole session in a real browser with real mouse and keys, against the real server, runtime and fit."""

import re

import numpy as np
import pytest
from headless_chromium import headless_chromium
from playwright.sync_api import expect

import vpltune
from vpltune.renderer.scene.placement import resolve_camera_and_lights

LONGEST = 300_000
"""Milliseconds that one step may take before it is given up: a fit on a busy machine."""
SETTLED = re.compile("settled")


@pytest.fixture
def page(window, playwright):
    with headless_chromium(playwright) as browser:
        # Small, so that the image is; the panel keeps its width.
        page = browser.new_page(viewport={"width": 720, "height": 420})
        page.set_default_timeout(LONGEST)
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(window.address)
        expect(page.locator("#label-a")).to_contain_text(SETTLED, timeout=LONGEST)
        yield page
        assert not errors


def stage_pixels(page) -> np.ndarray:
    """What the canvas of the stage shows, in device pixels."""
    width, height, pixels = page.evaluate(
        """() => {
            const canvas = document.querySelector('#image');
            const shown = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
            return [canvas.width, canvas.height, Array.from(shown.data)];
        }"""
    )
    return np.array(pixels, np.uint8).reshape(height, width, 4)[..., :3]


def drag(page, start: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    for share in np.linspace(0.2, 1.0, 5):
        page.mouse.move(*(np.array(start) + share * (np.array(end) - start)))
    page.mouse.up()


def open_files(page) -> None:
    """Open the menu of files, which closes when something was done."""
    if not page.locator("#file-menu").is_visible():
        page.locator("#open-files").click()


@pytest.mark.slow
def test_drag_tune_compare_undo_save_reload_and_load(window, page, scene_file, tmp_path):
    screenshots = tmp_path / "screenshots"
    screenshots.mkdir()

    def photograph(name: str) -> None:
        page.screenshot(path=screenshots / f"{name}.png")

    photograph("1 opened")
    before = window.lights[0]

    # Select the light in the list, and drag its gizmo to the side.
    page.locator("#light-list [role=option]").first.click()
    marker = page.locator("#gizmo [data-handle=move]").bounding_box()
    middle = marker["x"] + marker["width"] / 2, marker["y"] + marker["height"] / 2
    drag(page, middle, (middle[0] + 30, middle[1] + 20))
    expect(page.locator("#undo")).to_be_enabled(timeout=LONGEST)
    moved = window.lights[0]
    assert np.linalg.norm(moved.position_world - before.position_world) > 1e-3
    photograph("2 light dragged")

    # Tune, and watch the loss.
    page.locator("#tune").click()
    expect(page.locator("#loss-line")).to_have_attribute("points", re.compile(r"\d"), timeout=LONGEST)
    photograph("3 tuning")
    expect(page.locator("#fit-status")).to_be_visible(timeout=LONGEST)
    assert page.inner_text("#fit-status").strip().rstrip(":") in ("improved", "kept", "doubtful")
    assert len(page.inner_text("#fit-sentence")) > 20
    photograph("4 tuned")

    # The split, by keys.
    page.locator("#stage").focus()
    page.keyboard.press("Shift+Digit1")
    expect(page.locator("#label-b")).to_contain_text(SETTLED, timeout=LONGEST)
    line = page.locator("#split-line").bounding_box()
    drag(page, (line["x"] + 1, line["y"] + 60), (line["x"] - 80, line["y"] + 60))
    photograph("5 split")
    page.keyboard.press("0")

    # Undo goes back to where the light was.
    while page.locator("#undo").is_enabled():
        page.locator("#undo").click()
        page.wait_for_timeout(200)
    assert np.allclose(window.lights[0].position_world, before.position_world)
    page.locator("#redo").click()
    page.wait_for_function("() => !document.querySelector('#undo').disabled")
    assert np.allclose(window.lights[0].position_world, moved.position_world)

    # A value by hand; save the config by its key and the lights as a sidecar, and reload.
    number = page.locator('[data-parameter="intensity"] input.number')
    number.fill("2")
    number.press("Enter")
    path = tmp_path / "saved.json"
    open_files(page)
    page.locator("#path-config").fill(str(path))
    page.locator("#save-config button").click()
    page.wait_for_function("() => document.querySelector('#toasts').textContent.includes('wrote')")
    assert vpltune.read_config(path).parameters.intensity == 2.0
    open_files(page)
    page.locator("#save-sidecar button").click()
    page.wait_for_function("() => document.querySelector('#toasts').textContent.includes('vpltune.toml')")
    photograph("6 saved")
    page.reload()
    expect(page.locator("#label-a")).to_contain_text(SETTLED, timeout=LONGEST)

    # Load the saved file: the stage shows what the runtime draws without a browser, bitwise.
    open_files(page)
    page.locator("#path-load").fill(str(path))
    page.locator("#load button").click()
    page.wait_for_function("() => document.querySelector('#toasts').textContent.includes('read')")
    page.keyboard.press("Escape")
    page.wait_for_timeout(1000)
    expect(page.locator("#label-a")).to_contain_text(SETTLED, timeout=LONGEST)
    photograph("7 loaded")
    shown = stage_pixels(page)
    scene = vpltune.read_scene(scene_file)
    camera, lights, _ = resolve_camera_and_lights(scene, scene_file, None, None)
    assert np.allclose(lights[0].position_world, moved.position_world)
    view = vpltune.View("main", "fitted", (shown.shape[1], shown.shape[0]), camera, lights)
    drawn = vpltune.Runtime(scene).render(view, vpltune.read_config(path))
    assert np.array_equal(shown, drawn)
