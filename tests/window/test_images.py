"""What a page is sent: at rest what `vpltune render` draws, in motion the newest, and each page its own."""

import threading

import numpy as np
import pytest
from window_talk import Talk

import vpltune
from vpltune.renderer.frame.layer_display import for_display
from vpltune.renderer.scene.placement import resolve_camera_and_lights

SIZE = (96, 64)


@pytest.fixture
def headless(scene_file, config_file):
    """Draws a layer as `vpltune render` writes it to a PNG."""
    scene = vpltune.read_scene(scene_file)
    camera, lights, _ = resolve_camera_and_lights(scene, scene_file, None, None)
    runtime = vpltune.Runtime(scene)

    def draw(layer: str, config=None) -> np.ndarray:
        view = vpltune.View("main", "fitted", SIZE, camera, lights)
        pixels = runtime.render(view, config or vpltune.read_config(config_file), layer=layer)
        shown = for_display(runtime, layer, pixels)
        return shown if shown.dtype == np.uint8 else np.round(np.clip(shown, 0, 1) * 255).astype(np.uint8)

    return draw


def test_an_image_at_rest_is_bitwise_that_of_the_command_line(talk, headless):
    for layer in ("final", "direct", "indirect", "irradiance", "albedo", "normal", "depth"):
        shown = talk.shown(layer=layer)
        assert shown.header["settled"] and shown.header["size"] == list(SIZE)
        assert np.array_equal(shown.pixels, headless(layer)), layer


def test_each_config_is_drawn_in_its_pane_with_one_exposure(talk, headless):
    look = talk.look(a="hand", b="default")
    left, right = talk.image(look), talk.image(look, "b")
    assert (left.header["source"], right.header["source"]) == ("hand", "default")
    assert np.array_equal(left.pixels, headless("final"))
    # Another exposure would show direct light, which both share, differently: it rules a third of the image
    # and more.
    same = (np.abs(left.pixels.astype(int) - right.pixels) <= 2).all(axis=-1)
    assert same.mean() > 0.3


def test_layers_of_discs_and_maps_show_something(talk):
    final = talk.shown().pixels
    for layer in ("discs", "rsm", "maps"):
        pixels = talk.shown(layer=layer).pixels
        assert pixels.shape == final.shape
        assert pixels.std() > 5.0, layer
        assert not np.array_equal(pixels, final)


def test_frames_in_motion_are_smaller_and_the_newest_look_is_the_last_shown(talk):
    for _ in range(40):
        moving = talk.look(moving=True, size=[192, 128])
    last = talk.look(size=[192, 128])
    settled = talk.image(last)
    assert settled.header["size"] == [192, 128] and settled.header["settled"]
    in_motion = [image for image in talk.images if image.header["look"] <= moving]
    assert all(not image.header["settled"] for image in in_motion)
    assert all(image.header["size"][0] <= 192 for image in in_motion)
    # Looks that came while another was drawn are passed over: far fewer images than looks.
    assert len(in_motion) < 20


def test_a_parameter_takes_effect_and_undo_brings_back_the_same_image(talk):
    before = talk.shown().pixels
    state = talk.edit(gesture=1, parameter="intensity", value=4.0)
    state = talk.edit(gesture=1, parameter="intensity", value=8.0)
    assert state["undo_name"] == "intensity" and state["unsaved"]
    brighter = talk.shown().pixels
    assert not np.array_equal(brighter, before)
    talk.say("undo")
    state = talk.message("state")
    # One gesture is one step.
    assert not state["can_undo"] and state["can_redo"] and not state["unsaved"]
    assert np.array_equal(talk.shown().pixels, before)


def test_two_pages_share_the_document_and_keep_their_cameras(window, talk):
    with Talk(window.address) as other:
        turned = dict(other.scene["camera"], yfov=1.2)
        mine, theirs = talk.shown().pixels, other.shown(camera=turned).pixels
        assert not np.array_equal(mine, theirs)
        talk.edit(gesture=1, parameter="intensity", value=6.0)
        assert other.message("state")["configs"]["hand"]["parameters"]["intensity"] == 6.0
        assert other.image(1).header["camera"]["yfov"] == pytest.approx(1.2)


def test_a_page_that_goes_in_mid_frame_holds_up_nobody(window, talk):
    for _ in range(3):
        with Talk(window.address) as other:
            other.look(size=[400, 300])
    assert talk.shown().header["settled"]


def test_pages_at_the_same_time_are_all_served(window):
    seen = []

    def look() -> None:
        with Talk(window.address) as talk:
            for _ in range(3):
                seen.append(talk.shown().header["settled"])

    threads = [threading.Thread(target=look) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert seen == [True] * 12


def test_a_picked_place_lies_on_the_surface(talk):
    talk.shown()
    talk.say("pick", id=7, x=0.5, y=0.97, camera=talk.scene["camera"], seconds=None)
    picked = talk.message("picked")
    # The floor of the box is y = 0; a pixel of 64 rows is 1 mm of 55 there.
    assert picked["id"] == 7
    assert picked["position"][1] == pytest.approx(0.0, abs=1e-3)
    assert picked["normal"] == pytest.approx([0.0, 1.0, 0.0], abs=1e-3)
    eye = np.reshape(talk.scene["camera"]["to_world"], (4, 4))[:3, 3]
    assert picked["distance"] == pytest.approx(np.linalg.norm(picked["position"] - eye), rel=1e-6)


def test_measured_passes_have_the_names_of_the_frame(talk):
    talk.shown()
    talk.say("measure", source="hand")
    timings = talk.message("timings")
    names = [name for name, _ in timings["passes"]]
    assert {"geometry", "vpl_gather", "tone_mapping"} <= set(names)
    assert timings["milliseconds"] > 0.0
