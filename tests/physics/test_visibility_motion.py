"""A board carried through the lit room: its indirect shadow goes with it, at once and without flicker."""

import numpy as np
import pytest
from built_scenes import colored_room, room_view

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime

FRAMES = 16
STEP = 0.03
"""In a room that is 2 wide: as fast as a hand carries a thing at 60 frames a second."""
PARAMETERS = ArtistParameters(vpl_count=64)


def poses() -> list[np.ndarray]:
    room = colored_room()
    (board,) = [index for index, mesh in enumerate(room.meshes) if mesh.name == "board"]
    carried = []
    for frame in range(FRAMES):
        placed = np.array([instance.to_world for instance in room.instances])
        placed[board, 0, 3] += STEP * (frame - FRAMES / 2)
        placed[board, 1, 3] += 0.6
        carried.append(placed)
    return carried


def carried(gl_context, visibility: str, size: int = Quality().map_size) -> np.ndarray:
    """Indirect irradiance, [frames, height, width, 3]; the light is a lamp that shines beside the board."""
    runtime = Runtime(colored_room(), context=gl_context)
    config = TunedConfig(PARAMETERS, visibility=visibility, quality=Quality(map_size=size), light=ONE_BOUNCE)
    images = []
    for placed in poses():
        runtime.scene_buffers.set_pose(placed, np.zeros((0, 4, 4)))
        images.append(runtime.render(room_view("directional"), config, layer="irradiance"))
    return np.stack(images)


@pytest.fixture(scope="module")
def with_maps(gl_context):
    return carried(gl_context, "maps")


def test_there_is_no_lag(gl_context, with_maps):
    """The last frame of the way is bitwise the image of a runtime that never saw the frames before it."""
    runtime = Runtime(colored_room(), context=gl_context)
    runtime.scene_buffers.set_pose(poses()[-1], np.zeros((0, 4, 4)))
    config = TunedConfig(PARAMETERS, visibility="maps", light=ONE_BOUNCE)
    image = runtime.render(room_view("directional"), config, layer="irradiance")
    np.testing.assert_array_equal(image, with_maps[-1])


def test_the_shadow_goes_with_the_board(gl_context, with_maps):
    """The centre of what maps take away moves along with the board, by half of its way at least."""
    without = carried(gl_context, "transmittance")
    taken = np.maximum(without - with_maps, 0.0).sum(axis=(1, 3))
    columns = np.arange(taken.shape[1])
    centers = (taken * columns).sum(axis=1) / taken.sum(axis=1)
    # The image is 64 wide and shows 2.62 across the room's middle.
    way = STEP * (FRAMES - 1) * 64 / 2.62
    assert centers[-1] - centers[0] > 0.5 * way


@pytest.mark.slow
def test_flicker_is_bounded(gl_context, with_maps):
    """Images change from frame to frame by at most 1.1 times as much as with maps of 64² texels.

    1.00 was measured. What a finer map would show moving is the shadow itself.
    """
    clips = (with_maps, carried(gl_context, "maps", 64))
    changes = [np.abs(np.diff(clip, axis=0)).mean() / clip.mean() for clip in clips]
    assert changes[0] < 1.1 * changes[1]
