"""Light walks: light that is reflected again and again, and that glowing surfaces send to others."""

import numpy as np
from jaxtyping import Float32

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.visibility_map_layout import FRAME_TURNS_OVER
from vpltune.renderer.frame.vpl_pools import VPL_BYTES, DiscPool
from vpltune.renderer.frame.walk_samples import recorded_steps, walk_steps
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.ray_hierarchy import RayHierarchy
from vpltune.renderer.gpu.resources import Resources

SURVIVAL = 0.95
"""Largest chance that a walk goes on after its last step, else the albedo. A choice, as of the reference."""
MOST_RAYS = 64
"""Rays of a walk after its last step. A choice, as of the reference."""
SPREAD = 2.0
"""Radius of the disc that one of n samples stands for, in L/√n: n of them cover 4π L², about the surface of
what L is measured of. Only discs made of a single sample depend on it. A choice."""
_GROUP_SIZE = 256
"""Invocations that sum over samples. A choice."""
# The root of x⁵ = x + 1: its powers spread points evenly in four dimensions (Roberts 2018). A walk's first
# two numbers choose where it begins, the others its first direction.
_ROOT = 1.16730397826141868426


def walk_table(count: int) -> Float32[np.ndarray, "count 4"]:
    """`count` points in [0, 1)⁴: two numbers for the start of a walk, and two for its first direction."""
    steps = _ROOT ** -np.arange(1.0, 5.0)
    points = ((0.5 + np.arange(1, count + 1)[:, None] * steps) % 1.0).astype(np.float32)
    return np.minimum(points, np.nextafter(np.float32(1), np.float32(0)))


class LightWalksPass(FramePass):
    """RSM samples, samples of glowing surfaces, ray hierarchy → samples of later light: `later_samples`.

    Light tracing as in instant radiosity (Keller 1997), from the lights that the frame has already. It needs
    no light of the frame before, so that all bounces arrive at once.
    """

    name = "light_walks"

    def __init__(
        self,
        resources: Resources,
        hierarchy: RayHierarchy,
        bounces: int | None,
        glowing: DiscPool | None,
        disc_count: int,
        walks: int,
        *,
        has_lamps: bool,
    ):
        self._disc_count, self._walk_count = disc_count, walks
        self._hierarchy = hierarchy
        self._lamp_steps, self._glowing_steps = walk_steps(bounces)
        steps = recorded_steps(bounces, has_lamps=has_lamps, glows=glowing is not None)
        self.sample_count = walks * steps
        """Samples that it leaves, dark ones included."""
        context = resources.context
        resources["later_starts"] = context.buffer(reserve=disc_count * VPL_BYTES)
        resources["later_samples"] = context.buffer(reserve=self.sample_count * VPL_BYTES)
        shares = int(has_lamps) + int(glowing is not None)
        directions = np.repeat(walk_table(walks // shares)[:, 2:], shares, axis=0)
        resources["walk_directions"] = context.buffer(np.ascontiguousarray(directions).tobytes())
        defines = {
            "WALK_LAMPS": int(has_lamps),
            "WALK_GLOWING": int(glowing is not None),
            "WALK_STEPS": steps,
            "WALK_ENDS": int(bounces is None),
            "WALK_GROUP_SIZE": _GROUP_SIZE,
            "WALK_SPREAD": SPREAD,
        }
        starts = (*(("lamp_starts",) if has_lamps else ()), *((glowing.samples,) if glowing else ()))
        self._walks = ComputeProgram(
            resources,
            "light_walks/light_walks",
            {
                **hierarchy.defines,
                **defines,
                "FRAME_TURNS_OVER": FRAME_TURNS_OVER,
                "WALK_SURVIVAL": SURVIVAL,
                "WALK_MOST_RAYS": MOST_RAYS,
                "GLOWING_SAMPLES": glowing.sample_count if glowing else 0,
            },
            reads=(*hierarchy.reads, "walk_directions", *starts),
            writes=("later_samples",),
        )
        self._statistics = ComputeProgram(
            resources,
            "light_walks/walk_statistics",
            defines,
            writes=("later_samples", "later_starts", "frame_statistics"),
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Walk, then weigh the samples."""
        self._hierarchy.update()
        self._walks.dispatch(
            -(-self._walk_count // 64),
            walk_count=self._walk_count,
            longest=inputs.scene_diagonal,
            lamp_steps=self._lamp_steps,
            glowing_steps=self._glowing_steps,
            table_rotation=inputs.table_rotation,
        )
        self._statistics.dispatch(
            1,
            walk_count=self._walk_count,
            disc_count=self._disc_count,
            moment_origin=inputs.records.moment_origin,
        )
