"""Glowing surfaces: samples of their light, for discs that shine directly and for walks."""

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.point_table import r2_sequence
from vpltune.renderer.frame.vpl_pools import VPL_BYTES, DiscPool
from vpltune.renderer.gpu.glowing_triangles import GLOWING_READS, GlowingTriangles
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.resources import Resources

_GROUP_SIZE = 256
"""Invocations that sum the triangles' power. A choice."""


class GlowingSurfacesPass(FramePass):
    """Glowing triangles → samples of what they emit, drawn by power: `glowing_samples`.

    A sample is a VPL whose flux leaves one side of the surface with a cosine, as reflected light does.
    """

    name = "glowing_surfaces"

    def __init__(self, resources: Resources, triangles: GlowingTriangles, pool: DiscPool):
        self._triangles = triangles
        self._pool = pool
        context = resources.context
        triangles.add_to(resources)
        resources["glowing_cdf"] = context.buffer(reserve=4 * max(1, triangles.count))
        resources[pool.samples] = context.buffer(reserve=pool.sample_count * VPL_BYTES)
        resources["glowing_table"] = context.buffer(r2_sequence(pool.sample_count).tobytes())
        self._density = ComputeProgram(
            resources,
            "glowing_surfaces/glowing_density",
            {"GLOWING_GROUP_SIZE": _GROUP_SIZE},
            reads=GLOWING_READS,
            writes=("glowing_cdf",),
        )
        self._samples = ComputeProgram(
            resources,
            "glowing_surfaces/glowing_surfaces",
            reads=(*GLOWING_READS, "glowing_cdf", "glowing_table as point_table"),
            writes=(f"{pool.samples} as virtual_point_lights",),
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Sum the power, and draw the samples."""
        self._triangles.update()
        count = self._triangles.count
        self._density.dispatch(1, triangle_count=count)
        self._samples.dispatch(
            -(-self._pool.sample_count // 64),
            triangle_count=count,
            sample_count=self._pool.sample_count,
            table_rotation=inputs.table_rotation,
        )
