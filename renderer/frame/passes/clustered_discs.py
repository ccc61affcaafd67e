"""Clustered disc lights: VPLs that each take the light of the samples nearest to them."""

from vpltune.renderer.config.artist_parameters import parameter_spec
from vpltune.renderer.frame.disc_samples import DEFINES
from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.vpl_pools import VPL_BYTES, DiscPool
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.resources import Resources


class ClusteredDiscsPass(FramePass):
    """The samples of one pool → its VPLs, after `lloyd_iterations` of Lloyd (1982).

    Dong et al. 2009 ("Interactive indirect illumination using clustered visibility") make virtual area lights
    from RSMs alike. With few VPLs the point approximation dominates the error; a cluster shines as a disc of
    its spread (`shaders/common/vpl_disc.glsl`).

    The first pool's VPLs may be points instead. Others have no density that points could be drawn by, and are
    always clustered.
    """

    name = "clustered_discs"

    def __init__(self, resources: Resources, pool: DiscPool):
        self._resources = resources
        self._pool = pool
        self._programs: tuple[ComputeProgram, ComputeProgram, ComputeProgram] | None = None
        if pool.vpls not in resources:
            resources[pool.vpls] = resources.context.buffer(reserve=pool.vpl_count * VPL_BYTES)

    def wanted(self, inputs: FrameInputs) -> bool:
        """Where VPLs are discs."""
        return inputs.parameters.vpls_are_discs or self._pool.name != "first"

    def draw(self, inputs: FrameInputs) -> None:
        """Cluster. VPLs start at the first samples, and in a clip where the frame before left them.

        So they follow what moves in place of starting anew, which flickers less. A VPL that comes to have no
        samples in a clip, as after a cut, starts anew alone.
        """
        restart, owners, discs = self._programs or self._compiled()
        pool, state, resources = self._pool, inputs.state, self._resources
        count, samples = pool.vpl_count, pool.sample_count
        if state is None:
            resources.copy(pool.starts, pool.vpls)
        else:
            size = resources.buffer(pool.vpls).size
            carried = state.buffer(resources.context, f"{pool.vpls}_{count}", size)
            resources["carried_discs"] = carried
            resources.copy("carried_discs", pool.vpls)
        iterations = inputs.parameters.lloyd_iterations or int(parameter_spec("lloyd_iterations").default)
        for _ in range(iterations):
            if state is not None:
                restart.dispatch(-(-count // 64), vpl_count=count)
            owners.dispatch(-(-samples // 64), vpl_count=count, sample_count=samples)
            discs.dispatch(count, sample_count=samples)
        if state is not None:
            resources.copy(pool.vpls, "carried_discs")

    def _compiled(self) -> tuple[ComputeProgram, ComputeProgram, ComputeProgram]:
        """Compiled when they are first needed: points need none."""
        resources, defines, pool = self._resources, DEFINES, self._pool
        words = pool.vpl_count * -(-pool.sample_count // 32)
        resources[pool.members] = resources.context.buffer(bytes(4 * words))
        samples = f"{pool.samples} as vpl_samples"
        vpls = f"{pool.vpls} as virtual_point_lights"
        members = f"{pool.members} as vpl_members"
        self._programs = (
            ComputeProgram(
                resources,
                "clustered_discs/clustered_discs_restart",
                {},
                reads=(f"{pool.starts} as vpl_samples",),
                writes=(vpls,),
            ),
            ComputeProgram(
                resources,
                "clustered_discs/clustered_discs_owners",
                defines,
                reads=("frame_statistics", samples, vpls),
                writes=(members,),
            ),
            ComputeProgram(
                resources,
                "clustered_discs/clustered_discs",
                defines,
                reads=("frame_statistics", samples),
                writes=(vpls, members),
            ),
        )
        return self._programs
