"""Thousands of frames of a scene in which all moves: no error, no growth, and frame 0 comes back bitwise."""

import gc
import os
from pathlib import Path

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS
from moving_scenes import bent_board
from point_vpls import point_vpls

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.light_motion import BouncingLights
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.sequence import Sequence
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View

FPS = 60.0
SETTLED = 500
"""Frames after which memory must be flat."""
LARGEST_GROWTH = 1 << 20


def resident_bytes() -> int:
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


class Soak:
    """The bent board in its room, three kinds of lights and the camera moving, and 50 lights that bounce."""

    def __init__(self, context):
        self.scene = bent_board(seconds_per_turn=4.0)
        # Small maps and few VPLs: what a frame leaves behind does not depend on them.
        quality = Quality(interleave=2, map_size=8, rsm_resolution=64)
        self.config = TunedConfig(
            point_vpls(vpl_count=16, screen_space_strength=1.0), quality=quality, light=ONE_BOUNCE
        )
        self.runtime = Runtime(self.scene, RuntimeOptions(light_path="tiles"), context=context)
        camera = Camera(look_at(np.array([0.0, 0.0, 3.6]), np.zeros(3)), float(np.radians(40.0)))
        lights = tuple(ROOM_LIGHTS[kind] for kind in ("spot", "point", "directional"))
        self.sequence = Sequence(self.scene, View("soak", "fitted", (32, 24), camera, lights), "both")
        self.bouncing = BouncingLights(self.scene, 50, 1, 2.0)
        self.first_records = self.bouncing.records.copy()
        self.lights = DynamicLights(self.bouncing.records)

    def draw(self, frame: int) -> None:
        moment = self.sequence.at(frame / FPS)
        self.runtime.pose(moment.pose)
        self.runtime.draw(moment.view, self.config, lights=self.lights)
        self.bouncing.advance(1.0 / FPS)
        self.lights.update(self.bouncing.records)

    def first_image(self) -> np.ndarray:
        moment = self.sequence.at(0.0)
        self.runtime.pose(moment.pose)
        lights = DynamicLights(self.first_records)
        return self.runtime.render_radiance(moment.view, self.config, lights=lights).copy()


@pytest.mark.parametrize("frames", [100, pytest.param(10_000, marks=pytest.mark.slow)])
def test_soak(gl_context, frames):
    """Growth may be 1 MiB: a hundred bytes left behind by each frame, or one texture by them all."""
    soak = Soak(gl_context)
    first = soak.first_image()
    settled_at = min(SETTLED, frames // 2)
    settled = 0
    for frame in range(frames):
        soak.draw(frame)
        if frame == settled_at:
            settled = resident_bytes()
        if frame % 100 == 0:
            assert gl_context.error == "GL_NO_ERROR", frame
    growth = resident_bytes() - settled
    assert growth <= LARGEST_GROWTH, f"{growth / 1024:.0f} KiB since frame {settled_at}"
    assert gl_context.error == "GL_NO_ERROR"
    moved = soak.runtime.render_radiance(soak.sequence.at(1.0).view, soak.config)
    assert np.abs(moved - first).max() > 0.01, "nothing moved"
    np.testing.assert_array_equal(soak.first_image(), first)
