"""The least time of each pass of a frame: what it must compute and move, at the machine's rates.

What a pass moves is every resource that it declares, once. What it computes is counted for the passes that
arithmetic or rays rule; others are ruled by memory. A limit is no forecast: a pass of several dependent
steps, or one that draws small triangles, cannot reach it.
"""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from unittest import mock

import moderngl
import numpy as np

from benchmarks.harness.machine_rates import MachineRates
from benchmarks.speed.surrogate import FLOPS_PER_PAIR
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.drawn_frame import DrawnFrame
from vpltune.renderer.frame.frame_timing import PassClock
from vpltune.renderer.gpu.resources import Access, Resource, Resources

DISC_OPERATIONS = 170.0
"""Operations of a receiver and a disc, counted in shaders/common/vpl_disc.glsl as `FLOPS_PER_PAIR` is."""
LOOKUP_OPERATIONS = 65.0
"""Operations of a lookup into a visibility map, counted in shaders/common/vpl_visibility.glsl, and halved:
about half of all pairs face away from each other and have none."""
BOX_OPERATIONS = 40.0
"""Operations of a ray at a node of a binary hierarchy: two boxes of three slabs each."""
TRIANGLE_OPERATIONS = 50.0
"""Operations of a ray and a triangle (Möller and Trumbore 1997)."""
LIGHT_OPERATIONS = 45.0
"""Operations of a pixel and a dynamic light in whose range it is, counted in
shaders/common/dynamic_lights.glsl."""
SAMPLED_PIXELS = 400
"""Pixels over which the lights that reach one are averaged. A choice: 5 % at two sigma for ten lights."""
PIXELS_AT_ONCE = 20
"""Pixels whose distance to all lights is held at once. A choice, for memory."""

RASTER_TARGETS = {
    "geometry": ("gbuffer_depth", "gbuffer_normal", "gbuffer_albedo"),
    "reflective_shadow_map": ("rsm_depth", "rsm_normal", "rsm_reflectance"),
}
"""What passes write that draw triangles: declared by their framebuffer, not by name."""
USED_IN_PART = ("pixel_list", "visibility_details", "light_cells")
"""Buffers with room for the worst case, of which a frame moves an unknown part: not counted."""
WHOLE_RSM = ("reflective_shadow_map", "virtual_point_lights")
"""Passes that go through the whole RSM; others look up a part of it, which is not counted."""


def pass_limits(
    drawn: DrawnFrame, config: TunedConfig, triangles: int, rates: MachineRates
) -> dict[str, float]:
    """The least milliseconds of each pass that draws a frame again, in the order of the frame."""
    operations = pass_operations(drawn, config, triangles)
    return {
        name: rates.milliseconds(operations.get(name, 0.0), moved)
        for name, moved in pass_bytes(drawn).items()
    }


def pass_operations(drawn: DrawnFrame, config: TunedConfig, triangles: int) -> dict[str, float]:
    """Operations of the passes that arithmetic or rays rule."""
    setup = drawn.frame.setup
    pixels = float(math.prod(setup.size))
    pair = DISC_OPERATIONS if config.parameters.vpls_are_discs else FLOPS_PER_PAIR
    if setup.maps.size:
        pair += LOOKUP_OPERATIONS
    ray = BOX_OPERATIONS * math.log2(max(2, triangles)) + TRIANGLE_OPERATIONS
    operations = {
        "vpl_gather": pixels * setup.pools.total / setup.interleave**2 * pair,
        "vpl_visibility_maps": float(setup.pools.total * setup.maps.size**2) * ray,
    }
    lights = drawn.inputs.dynamic_lights
    if lights is not None:
        operations["light_pre_pass"] = pixels * lights_per_pixel(drawn) * LIGHT_OPERATIONS
    return operations


def lights_per_pixel(drawn: DrawnFrame) -> float:
    """Dynamic lights in whose range a pixel's surface is, averaged over some pixels of the image."""
    lights = drawn.inputs.dynamic_lights
    assert lights is not None, "no dynamic lights were drawn"
    captured = drawn.capture(maps=False)
    places = captured.position_world[captured.valid]
    chosen = np.random.default_rng(0).permutation(len(places))[:SAMPLED_PIXELS]
    position, reach = lights.numbers[:, :3].astype(np.float64), lights.numbers[:, 3].astype(np.float64)
    reached = 0
    for start in range(0, len(chosen), PIXELS_AT_ONCE):
        apart = places[chosen[start : start + PIXELS_AT_ONCE], None] - position
        reached += int(((apart**2).sum(axis=2) < reach**2).sum())
    return reached / max(1, len(chosen)) * float(captured.valid.mean())


def pass_bytes(drawn: DrawnFrame) -> dict[str, float]:
    """Bytes of all that each pass reads and writes, each resource once. Draws the frame once more."""
    recorder = _Recorder(drawn.context)
    original = Resources.access

    def access(self: Resources, accesses: Iterable[Access]) -> None:
        listed = list(accesses)
        recorder.note(self, [each.name for each in listed])
        original(self, listed)

    with mock.patch.object(Resources, "access", access):
        drawn.frame.draw(drawn.inputs, recorder)
        drawn.frame.resolve((1.0, 1.0), None, recorder)
    for name, targets in RASTER_TARGETS.items():
        recorder.used[name] |= {target: _size(drawn.frame.resources[target]) for target in targets}
    return {name: float(sum(used.values())) for name, used in recorder.used.items()}


class _Recorder(PassClock):
    """Notes what each pass uses, in place of its time."""

    def __init__(self, context: moderngl.Context):
        super().__init__(context, "wall")
        self.used: dict[str, dict[str, int]] = {}
        self._pass = ""

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        self._pass = name
        self.used.setdefault(name, {})
        yield
        self._pass = ""

    def note(self, resources: Resources, names: list[str]) -> None:
        """Add resources to those of the pass that is drawing."""
        if self._pass:
            self.used[self._pass] |= {
                name: _size(resources[name])
                for name in names
                if name not in USED_IN_PART and (not name.startswith("rsm_") or self._pass in WHOLE_RSM)
            }


_BYTES = {"f1": 1, "nu1": 1, "nu2": 2, "f2": 2, "f4": 4, "u4": 4}
"""Bytes of a texture's component, by moderngl's name."""


def _size(resource: Resource) -> int:
    if isinstance(resource, moderngl.Buffer):
        return resource.size
    return resource.width * resource.height * resource.components * _BYTES.get(resource.dtype, 4)
