"""How a scene moves, in plain arrays: a hierarchy of nodes, keyframes on them, and what hangs on which."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64, Int32

AnimatedProperty = Literal["translation", "rotation", "scale"]
Interpolation = Literal["step", "linear", "cubic_spline"]


@dataclass(frozen=True, eq=False)
class Channel:
    """Keyframes of one property of one node (glTF 2.0 section 3.11).

    Rotations are quaternions (x, y, z, w); between keys they take the shorter arc.
    """

    node: int
    """Row of `Animation.parents`."""
    animated: AnimatedProperty
    interpolation: Interpolation
    times: Float64[np.ndarray, " keys"]
    """Seconds, rising strictly."""
    values: Float64[np.ndarray, "keys components"]
    tangents: Float64[np.ndarray, "keys 2 components"] | None
    """Into and out of each key, per second; of cubic splines only."""
    duration: float
    """Seconds after which it starts again: that of the whole clip it belongs to."""


@dataclass(frozen=True, eq=False)
class Skin:
    """Joints that vertices follow."""

    joints: Int32[np.ndarray, " joints"]
    """Rows of `Animation.parents`."""
    inverse_bind: Float64[np.ndarray, "joints 4 4"]
    """From the mesh's own space to each joint's, as they stood when the two were joined."""


@dataclass(frozen=True, eq=False)
class Skinning:
    """What the vertices of one mesh follow; the mesh's own positions and normals are those at rest."""

    bind_positions: Float32[np.ndarray, "vertices 3"]
    bind_normals: Float32[np.ndarray, "vertices 3"]
    """Zero where the file has none: shading is flat there."""
    joints: Int32[np.ndarray, "vertices influences"]
    """Rows of `Skin.joints`."""
    weights: Float32[np.ndarray, "vertices influences"]
    """Not negative; each row sums to 1."""

    def rows(self, chosen: np.ndarray) -> "Skinning":
        """The same for vertices picked and repeated by index."""
        return Skinning(
            self.bind_positions[chosen], self.bind_normals[chosen], self.joints[chosen], self.weights[chosen]
        )


@dataclass(frozen=True, eq=False)
class Animation:
    """The moving part of a scene. Indices of −1 stand for nothing.

    A node without a channel stays at `rest_local`; one with a channel is translation · rotation · scale,
    each from its channel or at rest.
    """

    parents: Int32[np.ndarray, " nodes"]
    """A parent's row is before its children's."""
    rest_local: Float64[np.ndarray, "nodes 4 4"]
    rest_translation: Float64[np.ndarray, "nodes 3"]
    rest_rotation: Float64[np.ndarray, "nodes 4"]
    rest_scale: Float64[np.ndarray, "nodes 3"]
    channels: tuple[Channel, ...]
    instance_nodes: Int32[np.ndarray, " instances"]
    """The node of each of `Scene.instances`; −1 where a skin places it."""
    instance_local: Float64[np.ndarray, "instances 4 4"]
    """From the instance to its node (EXT_mesh_gpu_instancing); else the identity."""
    instance_skins: Int32[np.ndarray, " instances"]
    """Index into `skins` where the vertices follow joints."""
    light_nodes: Int32[np.ndarray, " lights"]
    camera_nodes: Int32[np.ndarray, " cameras"]
    skins: tuple[Skin, ...]
    root_to_world: Float64[np.ndarray, "4 4"]

    @property
    def duration(self) -> float:
        """Seconds of the longest clip."""
        return max((channel.duration for channel in self.channels), default=0.0)
