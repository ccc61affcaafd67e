"""The limit on a light's intensity is one of the light as it is drawn, so it follows the scene's size."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, room_view

from vpltune.cli.chosen_view import ChosenView
from vpltune.renderer.errors import InputError
from vpltune.renderer.export.glb_writer import write_glb
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.placement.scene_sidecar import completed_camera_and_lights
from vpltune.renderer.scene.placement.sidecar_file import sidecar_path, sidecar_text
from vpltune.renderer.scene.scene import Light, scaled
from vpltune.renderer.scene.working_scale import working_scale


def written_room(folder, factor, *lights):
    """The room as a file, with lights of its own; the path."""
    room = scaled(colored_room(), factor)
    path = folder / "room.glb"
    write_glb(path, type(room)(**{**vars(room), "lights": lights}))
    return path


@pytest.mark.parametrize("factor", [1e-12, 1.0, 1e9, 5e11])
def test_the_program_s_own_lights_are_read_back(tmp_path, factor):
    """From the sidecar that init writes and from a converted scene; at the largest size, 1e24 W/sr."""
    path = written_room(tmp_path, factor)
    scene = read_scene(path)
    camera, lights, _ = completed_camera_and_lights(scene, path, None, None)
    sidecar_path(path).write_text(sidecar_text(camera, lights))
    _, (spot,), _ = resolve_camera_and_lights(scene, path, None, None)
    # Fifteen digits are written.
    np.testing.assert_allclose(spot.intensity, lights[0].intensity, rtol=1e-14)
    (again,) = read_scene(written_room(tmp_path, factor, spot)).lights
    np.testing.assert_allclose(again.intensity, spot.intensity, rtol=1e-14)


def test_a_view_s_light_is_held_to_the_scene_it_is_drawn_in(tmp_path):
    """A views.json knows no scene."""
    path = written_room(tmp_path, 1.0)
    view = replace(room_view(), lights=(Light("point", np.full(3, 1e19), name="lamp"),))
    chosen = ChosenView(view, None, None, None, (8, 6))
    with pytest.raises(InputError, match=r"^view 'spot': light 0 'lamp': intensity must be at most 1e\+18"):
        chosen.placed(read_scene(path), path)


@pytest.mark.parametrize("kind", ["point", "directional"])
@pytest.mark.parametrize("factor", [1e-9, 1.0])
def test_lights_too_strong_to_draw_are_refused_by_name(tmp_path, kind, factor):
    """Wherever they come from. The room is 2·√3 units across, and is drawn in a unit of its own size."""
    path = written_room(tmp_path, factor)
    scene = read_scene(path)
    most = 1e18 if kind == "directional" else 1e18 / working_scale(scene) ** 2
    for strength, is_drawn in ((0.99 * most, True), (1.01 * most, False)):
        light = Light(kind, np.full(3, strength), name="lamp")
        if is_drawn:
            resolve_camera_and_lights(scene, path, None, (light,))
            assert read_scene(written_room(tmp_path, factor, light)).lights[0].kind == kind
            continue
        said = rf"light 0 'lamp': intensity must be at most {most:.3g} W/.* in a scene {3.464 * factor:.3g}"
        with pytest.raises(InputError, match=said.replace("+", r"\+")):
            resolve_camera_and_lights(scene, path, None, (light,))
        with pytest.raises(InputError, match="must be .*at most 1e\\+18|from 0 to 1e\\+18|in a scene"):
            read_scene(written_room(tmp_path, factor, light))
