"""Real scenes from others are read completely and quickly, with the sizes that their README reports."""

import time

import numpy as np
import pytest

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene

# Path, triangles with area, diagonal, textures, lights, cameras. Diagonals are from the folder's README.
SCENES = [
    ("bevy-cornellbox/CornellBox.glb", 36, 961, 0, 0, 0),
    ("kajiya-cornell-box/scene.gltf", 32, 3.49, 0, 0, 0),
    ("nvpro-cornellbox/cornellBox.gltf", 16352, 17.5, 0, 0, 1),
    ("godot-living-room/living_room.glb", 1551, 18.5, 0, 0, 0),
    ("godot-zdm2/zdm2.glb", 57638, 104, 0, 0, 0),
    ("cube2-steelribs/steelribs.obj", 45846, 1417, 0, 0, 0),
    ("bevy-mixedlightingexample/MixedLightingExample.gltf", 40898, 4.45, 3, 1, 0),
    ("bevy-irradiancevolumeexample/IrradianceVolumeExample.glb", 32, 57.5, 0, 0, 0),
    ("bevy-depthoffieldexample/DepthOfFieldExample.glb", 10610, 9.21, 3, 1, 0),
    ("playcanvas-house/house.glb", 10497, 0.736, 1, 0, 0),
    ("babylon-marble-tower/marbleTower.gltf", 78972, 68.7, 3, 0, 0),
    ("playcanvas-chess-board/chess-board.glb", 178845, 436, 3, 0, 0),
    ("sketchfab-macross-diorama/scene.glb", 102822, 8.04, 0, 0, 0),
]


@pytest.mark.parametrize(
    ("path", "triangles", "diagonal", "textures", "lights", "cameras"),
    SCENES,
    ids=lambda v: str(v).split("/")[0],
)
def test_real_scenes_are_read_whole(scenes_folder, path, triangles, diagonal, textures, lights, cameras):
    start = time.process_time()
    scene = read_scene(scenes_folder / path)
    seconds = time.process_time() - start
    assert scene.triangle_count() == triangles
    low, high = scene.bounds()
    # The README prints three digits.
    assert np.linalg.norm(high - low) == pytest.approx(diagonal, rel=5e-3)
    assert (len(scene.textures), len(scene.lights), len(scene.cameras)) == (textures, lights, cameras)
    # Measured: at most 0.9 s. The bound catches quadratic time.
    assert seconds < 30.0
    for mesh in scene.meshes:
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)
        assert mesh.triangles.min() >= 0
        assert mesh.triangles.max() < len(mesh.positions)


def test_missing_textures_of_the_open_map_are_named(scenes_folder):
    (warning,) = read_scene(scenes_folder / "cube2-steelribs" / "steelribs.obj").warnings
    assert warning.startswith("7 textures missing ('media/base/base4.png'")


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("bitterli-living-room/scene.xml", "Mitsuba XML is not read"),
        ("bitterli-staircase2/scene.xml", "Mitsuba XML is not read"),
    ],
)
def test_what_is_not_read_is_refused_in_one_line(scenes_folder, path, message):
    with pytest.raises(InputError, match=message) as refused:
        read_scene(scenes_folder / path)
    assert "\n" not in str(refused.value)
