"""Scenes from arrays: the same as from a file, and every broken rule is one line with argument and value."""

import numpy as np
import pytest
from built_scenes import colored_room, room_view

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.array_scene import scene_from_arrays
from vpltune.renderer.scene.environment import Environment, even_sky
from vpltune.renderer.scene.scene import Camera, Light, Material, Scene
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View

SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def as_arrays(scene: Scene) -> dict[str, np.ndarray]:
    """A scene of untransformed meshes as one set of arrays."""
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in scene.meshes)])
    colors = [scene.materials[mesh.material].base_color for mesh in scene.meshes]
    counts = [len(mesh.triangles) for mesh in scene.meshes]
    return {
        "positions": np.concatenate([mesh.positions for mesh in scene.meshes]),
        "triangles": np.concatenate(
            [mesh.triangles + start for mesh, start in zip(scene.meshes, starts, strict=False)]
        ),
        "triangle_albedo": np.repeat(colors, counts, axis=0),
    }


def test_an_image_is_that_of_the_scene_the_arrays_come_from(gl_context):
    """To one step of 8 bits: six meshes and one of them have the same corners, in another order."""
    room = colored_room()
    views = room_view(size=(48, 36))
    images = [
        Runtime(scene, context=gl_context).render(views, TunedConfig(light=ONE_BOUNCE)).astype(int)
        for scene in (room, scene_from_arrays(**as_arrays(room)))
    ]
    assert images[0].std() > 10.0
    assert np.abs(images[0] - images[1]).max() <= 1


def test_lists_do_and_a_scene_says_what_it_is():
    scene = scene_from_arrays(
        SQUARE.tolist(),
        HALVES.tolist(),
        albedo=[0.7, 0.5, 0.3],
        lights=[Light("spot", 10.0, [0, 0, 2], [0, 0, -1])],
        cameras=(Camera(look_at([0, 0, 3], [0, 0, 0]), 1.0, name="front"),),
    )
    assert repr(scene) == "Scene('arrays', 2 triangles, 1 instance, 1 material, 1 light, 1 camera)"
    np.testing.assert_array_equal(scene.materials[0].base_color, np.array([0.7, 0.5, 0.3], np.float32))
    np.testing.assert_array_equal(scene.lights[0].intensity, [10.0, 10.0, 10.0])
    assert scene.cameras[0].name == "front"


def test_colours_of_vertices_and_triangles_multiply():
    shades = np.linspace(0.0, 1.0, 12).reshape(4, 3)
    halves = np.array([[1.0, 0.5, 0.25], [0.5, 0.5, 0.5]])
    mesh = scene_from_arrays(SQUARE, HALVES, albedo=shades, triangle_albedo=halves).meshes[0]
    corners = shades[HALVES] * halves[:, None, :]
    np.testing.assert_allclose(mesh.colors[mesh.triangles], corners, rtol=1e-6)  # float32


def test_normals_are_kept_at_unit_length_and_absent_ones_are_flat():
    normals = np.tile((0.0, 3.0, 4.0), (4, 1))
    smooth = scene_from_arrays(SQUARE, HALVES, normals=normals).meshes[0]
    np.testing.assert_allclose(smooth.normals, np.tile((0.0, 0.6, 0.8), (4, 1)), rtol=1e-6)  # float32
    flat = scene_from_arrays(SQUARE, HALVES).meshes[0]
    np.testing.assert_array_equal(flat.normals, np.tile((0.0, 0.0, 1.0), (6, 1)))


def test_the_top_row_of_a_texture_is_at_v_zero(gl_context):
    """The upper half of the square is red, and the lower half is blue; to 1 % beside the border."""
    texels = np.zeros((64, 64, 3), np.uint8)
    texels[:32, :, 0], texels[32:, :, 2] = 188, 188
    uv = SQUARE[:, :2] * (1.0, -1.0) + (0.0, 1.0)
    scene = scene_from_arrays(SQUARE, HALVES, uv=uv, texture=texels)
    camera = Camera(look_at([0.5, 0.5, 1.0], [0.5, 0.5, 0.0]), 2.0 * np.arctan(0.4))
    view = View("front", "fitted", (32, 32), camera, ())
    albedo = Runtime(scene, context=gl_context).render(view, TunedConfig(light=ONE_BOUNCE), layer="albedo")
    level = float(linear_from_srgb(np.float32([188 / 255.0]))[0])
    np.testing.assert_allclose(albedo[:14], np.broadcast_to((level, 0.0, 0.0), (14, 32, 3)), atol=0.01)
    np.testing.assert_allclose(albedo[18:], np.broadcast_to((0.0, 0.0, level), (14, 32, 3)), atol=0.01)


BROKEN = {
    "positions: must have the shape [rows, 3], got [4, 2]": {"positions": SQUARE[:, :2]},
    "positions: must be an array of numbers": {"positions": [["a", 0, 0]]},
    "mesh: positions must be finite and at most 1e+12 in magnitude, got nan": {
        "positions": np.where(SQUARE == 1.0, np.nan, SQUARE)
    },
    "mesh: positions must be finite and at most 1e+12 in magnitude, got 1e+13": {"positions": SQUARE * 1e13},
    "the scene must be at least 1e-12 across": {"positions": SQUARE * 1e-14},
    "triangles: must be from 0 to below the 4 positions, got 4": {"triangles": HALVES + 1},
    "triangles: must be from 0 to below the 4 positions, got -1": {"triangles": HALVES - 1},
    "triangles: must be whole numbers, got float64": {"triangles": HALVES.astype(float)},
    "triangles: must have the shape [triangles, 3], got [6]": {"triangles": HALVES.ravel()},
    "triangles: at least one must have area": {"triangles": [[0, 1, 1]]},
    "normals: must have the shape [4, 3], got [3, 3]": {"normals": np.eye(3)},
    "uv: must have the shape [4, 2], got [4, 3]": {"uv": SQUARE},
    "albedo: must lie in [0, 1], got 1.5": {"albedo": 1.5},
    "albedo: must lie in [0, 1], got nan": {"albedo": [0.5, np.nan, 0.5]},
    "albedo: must be one number, RGB, or of the shape [4, 3], got [2]": {"albedo": [0.5, 0.5]},
    "triangle_albedo: must have the shape [2, 3], got [4, 3]": {"triangle_albedo": SQUARE},
    "triangle_albedo: must lie in [0, 1], got -1": {"triangle_albedo": -np.ones((2, 3))},
    "texture: must come with uv, got none": {"texture": np.zeros((2, 2, 3), np.uint8)},
    "texture: must be uint8 [height, width, 3], got float64 [2, 2, 3]": {
        "texture": np.zeros((2, 2, 3)),
        "uv": SQUARE[:, :2],
    },
    "texture: must have at most 16384 rows and columns": {
        "texture": np.zeros((1, 16385, 3), np.uint8),
        "uv": SQUARE[:, :2],
    },
    "emission: must be from 0 to 1e+18, got -1": {"emission": -1.0},
    "emission: must be from 0 to 1e+18, got nan": {"emission": [0.0, np.nan, 1.0]},
    "emission: must be from 0 to 1e+18, got 1e+30": {"emission": 1e30},
    "emission: must be one number or RGB, got [2]": {"emission": [1.0, 1.0]},
    "environment: radiance must be from 0 to 1e+18, got -1 to 1": {
        "environment": even_sky((1.0, -1.0, 1.0)),
    },
    "environment: radiance must be from 0 to 1e+18, got nan to nan": {
        "environment": even_sky((np.nan, 1.0, 1.0)),
    },
    "lights[0].intensity: must not be negative": {"lights": [Light("point", -1.0)]},
    "lights[0].intensity: must be 3 finite numbers": {"lights": [Light("point", np.nan)]},
    "lights[0]: cone angles must satisfy": {"lights": [Light("spot", 1.0, inner_cone=1.0, outer_cone=0.5)]},
    "lights[0].position: must be 3 finite numbers": {"lights": [Light("point", 1.0, [0.0, np.inf, 0.0])]},
    "cameras[0].yfov: must lie in (0, π) radians, got 60.0": {"cameras": [Camera(np.eye(4), 60.0)]},
    "cameras[0].to_world: must be a rigid 4 × 4 matrix": {"cameras": [Camera(2.0 * np.eye(4), 1.0)]},
}


@pytest.mark.parametrize("message", BROKEN)
def test_a_broken_rule_is_one_line_with_argument_and_value(message):
    with pytest.raises(InputError) as caught:
        scene_from_arrays(**{"positions": SQUARE, "triangles": HALVES, **BROKEN[message]})
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_emission_and_environment_are_taken():
    scene = scene_from_arrays(
        SQUARE,
        HALVES,
        emission=[3.0, 2.0, 1.0],
        emits_both_ways=True,
        environment=Environment(np.ones((600, 1200, 3), np.float32)),
    )
    (material,) = scene.materials
    assert (material.emission, material.emits_both_ways) == ((3.0, 2.0, 1.0), True)
    assert scene.environment is not None
    assert scene.environment.radiance.shape == (512, 1024, 3)
    np.testing.assert_allclose(scene.environment.radiance, 1.0, rtol=1e-6)
    assert scene_from_arrays(SQUARE, HALVES).environment is None
    assert scene_from_arrays(SQUARE, HALVES, emission=2).materials[0].emission == (2.0, 2.0, 2.0)


def test_a_spots_hard_edge_is_softened_as_in_a_file():
    spot = Light("spot", 1.0, inner_cone=0.5, outer_cone=0.5, name="lamp")
    (light,) = scene_from_arrays(SQUARE, HALVES, lights=[spot]).lights
    assert 0.0 < light.inner_cone < light.outer_cone == 0.5
    assert light.name == "lamp"


def test_arrays_are_not_printed():
    """A repr is one short line, however large the scene."""
    many = np.tile(SQUARE, (500, 1)) + np.arange(500).repeat(4)[:, None]
    scene = scene_from_arrays(many, (HALVES + 4 * np.arange(500)[:, None, None]).reshape(-1, 3))
    assert repr(scene) == "Scene('arrays', 1,000 triangles, 1 instance, 1 material)"
    assert repr(scene.meshes[0]) == "Mesh('arrays', 3,000 vertices, 1,000 triangles)"
    assert isinstance(scene.materials[0], Material)
