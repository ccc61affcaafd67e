"""Animation data in plain arrays: a node hierarchy, keyframes, skins, and what is attached to each node."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64, Int32

AnimatedProperty = Literal["translation", "rotation", "scale"]
Interpolation = Literal["step", "linear", "cubic_spline"]


@dataclass(frozen=True, eq=False)
class Channel:
    """Keyframes for one property of one node (glTF 2.0 section 3.11).

    Rotations are quaternions (x, y, z, w) and interpolate along the shorter arc.
    """

    node: int
    """Index into `Animation.parents`."""
    animated: AnimatedProperty
    interpolation: Interpolation
    times: Float64[np.ndarray, " keys"]
    """Seconds, strictly increasing."""
    values: Float64[np.ndarray, "keys components"]
    tangents: Float64[np.ndarray, "keys 2 components"] | None
    """In-tangent and out-tangent of each key, per second. None unless the channel is a cubic spline."""
    duration: float
    """Seconds after which the channel repeats: the length of the whole clip that it belongs to."""


@dataclass(frozen=True, eq=False)
class Skin:
    """The joints of one skin."""

    joints: Int32[np.ndarray, " joints"]
    """Indices into `Animation.parents`."""
    inverse_bind: Float64[np.ndarray, "joints 4 4"]
    """Transform from mesh space to each joint's space in the bind pose."""


@dataclass(frozen=True, eq=False)
class Skinning:
    """Joints and weights of a mesh's vertices, with positions and normals in the bind pose."""

    bind_positions: Float32[np.ndarray, "vertices 3"]
    bind_normals: Float32[np.ndarray, "vertices 3"]
    """Zero if the file has no normals; shading is then flat."""
    joints: Int32[np.ndarray, "vertices influences"]
    """Indices into `Skin.joints`."""
    weights: Float32[np.ndarray, "vertices influences"]
    """Non-negative; each row sums to 1."""

    def rows(self, chosen: np.ndarray) -> "Skinning":
        """The skinning of the vertices with the indices `chosen`, which may repeat."""
        return Skinning(
            self.bind_positions[chosen], self.bind_normals[chosen], self.joints[chosen], self.weights[chosen]
        )


@dataclass(frozen=True, eq=False)
class Animation:
    """The animated node hierarchy of a scene. An index of −1 means none.

    A node without channels keeps `rest_local`. A node with a channel is translation · rotation · scale, where
    each part comes from its channel, or from the rest pose if it has none.
    """

    parents: Int32[np.ndarray, " nodes"]
    """Index of each node's parent. Parents come before their children."""
    rest_local: Float64[np.ndarray, "nodes 4 4"]
    rest_translation: Float64[np.ndarray, "nodes 3"]
    rest_rotation: Float64[np.ndarray, "nodes 4"]
    rest_scale: Float64[np.ndarray, "nodes 3"]
    channels: tuple[Channel, ...]
    instance_nodes: Int32[np.ndarray, " instances"]
    """The node of each of `Scene.instances`; −1 if a skin places it."""
    instance_local: Float64[np.ndarray, "instances 4 4"]
    """Transform from the instance to its node: from EXT_mesh_gpu_instancing, or the identity."""
    instance_skins: Int32[np.ndarray, " instances"]
    """Index into `skins`; −1 if no animated skin deforms the instance."""
    light_nodes: Int32[np.ndarray, " lights"]
    """The node of each of `Scene.lights`."""
    camera_nodes: Int32[np.ndarray, " cameras"]
    """The node of each of `Scene.cameras`."""
    skins: tuple[Skin, ...]
    root_to_world: Float64[np.ndarray, "4 4"]
    """Transform above all root nodes; `scaled` puts the scale of the scene here."""

    @property
    def duration(self) -> float:
        """Length of the longest clip in seconds."""
        return max((channel.duration for channel in self.channels), default=0.0)
