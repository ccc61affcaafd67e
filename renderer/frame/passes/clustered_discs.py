"""VPL cells: VPLs moved to the middle of the light that they stand for."""

import moderngl

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms

SAMPLES = 4096
"""Of the RSM, at least."""
SAMPLES_OF_VPL = 4
LARGEST_COUNT = 4096
"""VPLs. More are left where they were drawn: every sample looks at every VPL."""
NORMAL_REACH = 0.7
"""In L: how far apart it counts that normals differ by 1. The best of 0.3, 0.7 and 1.5."""


def sample_count(vpl_count: int) -> int:
    """How many samples the cells of so many VPLs are made of."""
    return max(SAMPLES, SAMPLES_OF_VPL * vpl_count)


class ClusteredDiscsPass:
    """Samples of the RSM, VPLs → the VPLs, each with the light of the samples that are nearest to it.

    Some steps of Lloyd (1982), as Dong et al. 2009 ("Interactive indirect illumination using clustered
    visibility") make virtual area lights from RSMs. What is wrong with an image of 32 points is most of all
    their form; a cell shines as a disc of its spread (`shaders/common/vpl_disc.glsl`).
    """

    def __init__(self, context: moderngl.Context, vpl_count: int):
        self._context = context
        self._vpl_count = vpl_count
        self.sample_count = sample_count(vpl_count)
        defines = {**buffer_bindings.DEFINES, "NORMAL_REACH": NORMAL_REACH}
        self._owners = load_compute(context, "clustered_discs/clustered_discs_owners", defines)
        self._cells = load_compute(context, "clustered_discs/clustered_discs", defines)
        self._owner_buffer = context.buffer(reserve=self.sample_count * 4)

    def draw(self, samples: moderngl.Buffer, vpls: moderngl.Buffer, steps: int) -> None:
        """Move the VPLs, which are the first of the samples, so often; the frame's statistics are bound."""
        context = self._context
        samples.bind_to_storage_buffer(buffer_bindings.VPL_SAMPLES)
        self._owner_buffer.bind_to_storage_buffer(buffer_bindings.VPL_OWNERS)
        # Of what a shader has written a copy knows after this barrier alone; itself, it needs none.
        context.memory_barrier(context.BUFFER_UPDATE_BARRIER_BIT)
        context.copy_buffer(vpls, samples, size=vpls.size)
        set_uniforms(self._owners, vpl_count=self._vpl_count, sample_count=self.sample_count)
        set_uniforms(self._cells, sample_count=self.sample_count)
        for _ in range(steps):
            self._owners.run(-(-self.sample_count // 64))
            context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)
            self._cells.run(self._vpl_count)
            context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)
