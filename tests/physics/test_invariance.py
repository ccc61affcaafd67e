"""What must not change the image: more VPLs, finer maps, more pixels, and the scene's scale."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view
from moving_scenes import bent_board

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.animation import Pose
from vpltune.renderer.scene.dynamic_lights import DynamicLights, point_lights, scaled_records
from vpltune.renderer.scene.scene import Camera, scaled
from vpltune.renderer.scene.sequence import Sequence
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, scaled_view

ROTATIONS = ((0.0, 0.0), (0.3, 0.7), (0.6, 0.1), (0.15, 0.45))
PARAMETERS = ArtistParameters(intensity=1.3, falloff_footprint=0.8, extinction_coefficient=0.3, vpl_count=64)
CONFIG = TunedConfig(PARAMETERS, quality=Quality(rsm_resolution=256), light=ONE_BOUNCE)
"""Few discs and a small RSM, which take a sixth of the time. The largest error of an image was 4e-4; with 512
discs it is 1.1e-3."""


def mean_irradiance(gl_context, view: View, vpl_count=1024, rsm_resolution=512) -> float:
    config = TunedConfig(
        ArtistParameters(vpl_count=vpl_count),
        quality=Quality(rsm_resolution=rsm_resolution),
        light=ONE_BOUNCE,
    )
    frames = Runtime(colored_room(), context=gl_context).captures(view, config, ROTATIONS)
    return float(np.mean([frame.indirect_irradiance[frame.valid].mean() for frame in frames]))


def inside_view(light: str, size=(64, 48)) -> View:
    view = room_view(light, size)
    camera = Camera(look_at(np.array([0.2, 0.1, 0.95]), np.array([0.0, -0.2, -1.0])), 1.0)
    return View(view.name, view.split, size, camera, view.lights)


@pytest.mark.slow
@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_mean_irradiance_is_stable(gl_context, light):
    """Doubling the VPL count, the RSM resolution or the image size moves the mean by less than 1 %.

    The mean is over four rotations of the point table: the sun also lights the room from outside, and
    how many of 1,024 VPLs fall inside is itself uncertain by about one percent.
    The camera stands inside, so that an image's edge is not the room's: a silhouette between two pixels
    would move the mean of all seen by more.
    """
    base = mean_irradiance(gl_context, inside_view(light))
    assert base > 0.0
    more_vpls = mean_irradiance(gl_context, inside_view(light), vpl_count=2048)
    finer_map = mean_irradiance(gl_context, inside_view(light), rsm_resolution=1024)
    more_pixels = mean_irradiance(gl_context, inside_view(light, (128, 96)))
    np.testing.assert_allclose(more_vpls, base, rtol=1e-2)
    np.testing.assert_allclose(finer_map, base, rtol=1e-2)
    np.testing.assert_allclose(more_pixels, base, rtol=1e-2)


@pytest.mark.parametrize(
    "factor",
    [
        *(1e-12, 0.1, 2e11),
        *(pytest.param(factor, marks=pytest.mark.slow) for factor in (1e-8, 0.01, 10.0, 100.0, 1e8)),
    ],
)
@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_scale_changes_nothing(gl_context, light, factor):
    """Scene, camera and light scaled together give the same image from the same config, to 2e-3.

    The bound is on the relative RMSE: where rounding moves a silhouette or a shadow's edge by a texel,
    single pixels may differ, and an RSM sample between two clusters may change its owner.
    """
    view, config = room_view(light), CONFIG
    runtime = Runtime(colored_room(), context=gl_context)
    other = Runtime(scaled(colored_room(), factor), context=gl_context)
    image = runtime.render_radiance(view, config)
    grown = other.render_radiance(scaled_view(view, factor), config)
    error = np.sqrt(np.mean((grown - image) ** 2) / np.mean(image**2))
    assert error < 2e-3
    one, grown = runtime.capture(view, config), other.capture(scaled_view(view, factor), config)
    assert grown.scene_length == pytest.approx(factor * one.scene_length, rel=1e-3)
    for name, power in (("position_world", 1), ("depth", 1), ("vpl_footprint", 1), ("vpl_flux", 2)):
        expected = factor**power * np.abs(getattr(one, name)).mean(dtype=np.float64)
        found = np.abs(getattr(grown, name)).mean(dtype=np.float64)
        assert found == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("factor", [1e-10, 1e10])
def test_dynamic_lights_and_poses_follow_the_scale(gl_context, factor):
    """In a scene that is drawn in a unit of its own, to 2e-3 as above."""
    room, view = colored_room(), room_view("spot")
    records = point_lights(np.array([[0.2, 0.3, 0.1], [-0.4, 0.1, 0.2]]), np.full(3, 0.4), 0.8)
    moved = np.stack([instance.to_world for instance in room.instances])
    moved[-1, :3, 3] += (0.1, 0.2, 0.0)
    images = []
    for scale in (1.0, factor):
        runtime = Runtime(scaled(room, scale), context=gl_context)
        grow = np.diag([scale, scale, scale, 1.0])
        runtime.pose(Pose(grow @ moved, np.zeros((0, 4, 4)), (), ()))
        lights = DynamicLights(scaled_records(records, scale))
        images.append(runtime.render_radiance(scaled_view(view, scale), CONFIG, lights=lights))
    error = np.sqrt(np.mean((images[1] - images[0]) ** 2) / np.mean(images[0] ** 2))
    assert error < 2e-3


@pytest.mark.parametrize("factor", [1e-12, 1e11])
def test_motion_follows_the_scale(gl_context, factor):
    """A file with coordinates so small or large moves as that of thousandths does, to 2e-3 as above."""
    images = []
    for size in (1e-3, factor):
        scene = in_units(bent_board(), size)
        runtime = Runtime(scene, context=gl_context)
        view = scaled_view(room_view("spot"), size)
        frames = []
        for seconds in (0.0, 1.0):
            runtime.pose(Sequence(scene, view, "none").at(seconds).pose)
            frames.append(runtime.render_radiance(view, CONFIG))
        images.append(np.stack(frames))
    assert np.abs(images[0][1] - images[0][0]).mean() > 0.01 * images[0].mean()  # the board turns
    error = np.sqrt(np.mean((images[1] - images[0]) ** 2) / np.mean(images[0] ** 2))
    assert error < 2e-3


def in_units(scene, size):
    """The scene as a file has it whose vertices are `size` times as far out; its nodes only turn."""
    meshes = [
        replace(
            mesh,
            positions=mesh.positions * np.float32(size),
            skinning=mesh.skinning
            and replace(mesh.skinning, bind_positions=mesh.skinning.bind_positions * np.float32(size)),
        )
        for mesh in scene.meshes
    ]
    return replace(scene, meshes=tuple(meshes))


def test_no_absolute_length_in_a_shader():
    """No tiny constant in a shader may be a length: each one allowed is listed with what it is."""
    import re
    from importlib import resources

    allowed = {
        "1e-30",  # keeps a quotient finite at zero, far below any square of a length that float32 holds
        "1e-36",  # as that, of a length in L to the fourth
        "1e-6",  # a share of a disc's radius
        "1e-12",  # a ratio of squared lengths, or a squared sine
        "1e-3",  # a share of the scene length
        "2e-3",  # a share of a distance
        "1e-4",  # a cosine
        "1e-5",  # a share of the scene's diagonal
        "1e-8",  # a share of a direction
    }
    number = re.compile(r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+)e-\d+")
    for path in _shader_files(resources.files("vpltune.shaders")):
        code = re.sub(r"//.*", "", path.read_text(encoding="utf-8"))
        for found in number.findall(code):
            assert found in allowed, f"{path.name}: {found}"


def _shader_files(folder):
    for entry in folder.iterdir():
        if entry.is_dir():
            yield from _shader_files(entry)
        elif entry.name.endswith((".comp", ".vert", ".frag", ".glsl")):
            yield entry


def test_frames_repeat_bitwise(gl_context):
    """The same view drawn twice, another in between, is the same to the last bit."""
    runtime = Runtime(colored_room(), context=gl_context)
    first = runtime.capture(room_view("spot"), CONFIG)
    runtime.capture(room_view("directional"), CONFIG)
    again = runtime.capture(room_view("spot"), CONFIG)
    np.testing.assert_array_equal(again.indirect_irradiance, first.indirect_irradiance)
    np.testing.assert_array_equal(again.vpl_position_world, first.vpl_position_world)
