"""Joined VPLs: all pools of a frame in one buffer, for the passes that make no difference between them."""

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.vpl_pools import VPL_BYTES, DiscPool
from vpltune.renderer.gpu.resources import Resources


class JoinedVplsPass(FramePass):
    """The VPLs of each pool → `virtual_point_lights`. A frame of one pool needs no copy."""

    name = "clustered_discs"

    def __init__(self, resources: Resources, pools: list[DiscPool]):
        self._resources = resources
        self._pools = pools
        if len(pools) == 1:
            resources.alias("virtual_point_lights", pools[0].vpls)
        else:
            size = sum(pool.vpl_count for pool in pools) * VPL_BYTES
            resources["virtual_point_lights"] = resources.context.buffer(reserve=size)

    def wanted(self, inputs: FrameInputs) -> bool:
        """With more than one pool."""
        return len(self._pools) > 1

    def draw(self, inputs: FrameInputs) -> None:
        """Copy one after the other."""
        start = 0
        for pool in self._pools:
            self._resources.copy(pool.vpls, "virtual_point_lights", start)
            start += pool.vpl_count * VPL_BYTES
