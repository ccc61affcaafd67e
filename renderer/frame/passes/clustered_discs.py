"""Clustered disc lights: VPLs that each take the light of the RSM samples nearest to them."""

from vpltune.renderer.frame.disc_samples import DEFINES, sample_count
from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.resources import Resources


class ClusteredDiscsPass(FramePass):
    """RSM samples → the VPLs, after `lloyd_iterations` of Lloyd (1982).

    Dong et al. 2009 ("Interactive indirect illumination using clustered visibility") make virtual area lights
    from RSMs alike. With few VPLs the point approximation dominates the error; a cluster shines as a disc of
    its spread (`shaders/common/vpl_disc.glsl`).
    """

    name = "clustered_discs"

    def __init__(self, resources: Resources, vpl_count: int):
        self._resources = resources
        self._vpl_count = vpl_count
        self._programs: tuple[ComputeProgram, ComputeProgram, ComputeProgram] | None = None

    def wanted(self, inputs: FrameInputs) -> bool:
        """Where VPLs are discs."""
        return inputs.parameters.vpls_are_discs

    def draw(self, inputs: FrameInputs) -> None:
        """Cluster. VPLs start at the first samples, and in a clip where the frame before left them.

        So they follow what moves in place of starting anew, which flickers less. A VPL that comes to have no
        samples in a clip, as after a cut, starts anew alone.
        """
        restart, owners, discs = self._programs or self._compiled()
        count, samples, state = self._vpl_count, sample_count(self._vpl_count), inputs.state
        if state is None:
            self._resources.copy("vpl_samples", "virtual_point_lights")
        else:
            size = self._resources.buffer("virtual_point_lights").size
            carried = state.buffer(self._resources.context, f"clustered_discs_{count}", size)
            self._resources["carried_discs"] = carried
            self._resources.copy("carried_discs", "virtual_point_lights")
        for _ in range(inputs.parameters.lloyd_iterations):
            if state is not None:
                restart.dispatch(-(-count // 64), vpl_count=count)
            owners.dispatch(-(-samples // 64), vpl_count=count, sample_count=samples)
            discs.dispatch(count, sample_count=samples)
        if state is not None:
            self._resources.copy("virtual_point_lights", "carried_discs")

    def _compiled(self) -> tuple[ComputeProgram, ComputeProgram, ComputeProgram]:
        """Compiled when they are first needed: points need none."""
        resources, defines = self._resources, DEFINES
        words = self._vpl_count * -(-sample_count(self._vpl_count) // 32)
        resources["vpl_members"] = resources.context.buffer(bytes(4 * words))
        self._programs = (
            ComputeProgram(
                resources,
                "clustered_discs/clustered_discs_restart",
                {},
                reads=("vpl_samples",),
                writes=("virtual_point_lights",),
            ),
            ComputeProgram(
                resources,
                "clustered_discs/clustered_discs_owners",
                defines,
                reads=("frame_statistics", "vpl_samples", "virtual_point_lights"),
                writes=("vpl_members",),
            ),
            ComputeProgram(
                resources,
                "clustered_discs/clustered_discs",
                defines,
                reads=("frame_statistics", "vpl_samples"),
                writes=("virtual_point_lights", "vpl_members"),
            ),
        )
        return self._programs
