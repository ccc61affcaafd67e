"""glTF animations: their channels, and the part of the node hierarchy that they move.

A broken channel is left out with a warning, because the scene at rest does not need it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64, Int32

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_accessors import Elements, GltfAccessors
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.gltf_nodes import GltfNodes
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.limits import LARGEST_COORDINATE, MAX_CHANNELS
from vpltune.renderer.scene.scene_animation import AnimatedProperty, Animation, Channel, Interpolation, Skin
from vpltune.renderer.scene.transforms import trs_matrices

# Animated properties and the accessor type of their values, then interpolations (glTF 2.0 section 3.11).
_PROPERTIES: dict[AnimatedProperty, str] = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}
_INTERPOLATIONS: dict[str, Interpolation] = {
    "STEP": "step",
    "LINEAR": "linear",
    "CUBICSPLINE": "cubic_spline",
}


@dataclass
class Placed:
    """The nodes and skins of the scene's instances, lights and cameras, in the scene's order.

    Nodes are indices into the document's nodes.
    """

    instance_nodes: list[int] = field(default_factory=list)
    """The node of each instance; −1 if a skin places it."""
    instance_local: list[Float64[np.ndarray, "4 4"]] = field(default_factory=list)
    """Transform from each instance to its node."""
    instance_skins: list[int] = field(default_factory=list)
    """Index into `skins` for each instance; −1 if no animated skin deforms it."""
    light_nodes: list[int] = field(default_factory=list)
    camera_nodes: list[int] = field(default_factory=list)
    skins: list[tuple[list[int], Float64[np.ndarray, "joints 4 4"]]] = field(default_factory=list)
    """The joints' nodes and their inverse bind matrices."""


def read_channels(document: GltfDocument, nodes: GltfNodes, accessors: GltfAccessors) -> list[Channel]:
    """The valid channels of all animations. `Channel.node` is an index into the document's nodes.

    All animations play at once, and each loops with its own period. If two channels animate the same property
    of a node, the first one wins.
    """
    try:
        clips = [(clip, clip.objects("channels")) for clip in document.list_of("animations")]
    except SceneFileError as error:
        document.warnings.add(f"animations are left out: {error}")
        return []
    total = sum(len(channels) for _, channels in clips)
    if total > MAX_CHANNELS:
        document.warnings.add(
            f"animations are left out: they must have at most {MAX_CHANNELS:,} channels, got {total:,}"
        )
        return []
    taken: dict[tuple[int, str], Channel] = {}
    faults: list[str] = []
    repeated = 0
    for clip, members in clips:
        of_clip = []
        for member in members:
            try:
                of_clip += _channel(clip, member, document, nodes, accessors)
            except SceneFileError as error:
                faults.append(str(error))
        duration = max((float(channel.times[-1]) for channel in of_clip), default=0.0)
        for channel in of_clip:
            key = (channel.node, channel.animated)
            repeated += key in taken
            taken.setdefault(key, replace(channel, duration=duration))
    if faults:
        document.warnings.add(f"{len(faults)} of {total} animation channels are left out: {faults[0]}")
    if repeated:
        document.warnings.add(
            f"{repeated} of {total} animation channels are left out: an earlier one animates the same "
            "property"
        )
    return list(taken.values())


def placed_animation(channels: Sequence[Channel], placed: Placed, nodes: GltfNodes) -> Animation | None:
    """The animation of the placed instances, lights and cameras; None if none of them moves."""
    leaves = [*placed.instance_nodes, *placed.light_nodes, *placed.camera_nodes]
    leaves += [joint for joints, _ in placed.skins for joint in joints]
    order = _with_ancestors([leaf for leaf in leaves if leaf >= 0], nodes.parents)
    row_of = {node: row for row, node in enumerate(order)} | {-1: -1}
    used = [replace(channel, node=row_of[channel.node]) for channel in channels if channel.node in row_of]
    if not used:
        return None
    rest = [_rest(nodes.nodes[node]) for node in order]
    return Animation(
        parents=_rows([nodes.parents[node] for node in order], row_of),
        rest_local=np.stack([local for local, _, _, _ in rest]),
        rest_translation=np.stack([translation for _, translation, _, _ in rest]),
        rest_rotation=np.stack([rotation for _, _, rotation, _ in rest]),
        rest_scale=np.stack([scale for _, _, _, scale in rest]),
        channels=tuple(used),
        instance_nodes=_rows(placed.instance_nodes, row_of),
        instance_local=np.array(placed.instance_local, np.float64).reshape(-1, 4, 4),
        instance_skins=np.array(placed.instance_skins, np.int32),
        light_nodes=_rows(placed.light_nodes, row_of),
        camera_nodes=_rows(placed.camera_nodes, row_of),
        skins=tuple(Skin(_rows(joints, row_of), inverse_bind) for joints, inverse_bind in placed.skins),
        root_to_world=np.eye(4),
    )


def _channel(
    clip: JsonObject, member: JsonObject, document: GltfDocument, nodes: GltfNodes, accessors: GltfAccessors
) -> list[Channel]:
    """The channel, with its duration still unset, or nothing if what it animates is not supported."""
    target = member.required_object("target")
    animated = target.string("path")
    if animated in ("weights", "pointer"):
        document.warnings.tally(
            "1 animation channel of morph weights or materials is ignored",
            "{n} animation channels of morph weights or materials are ignored",
        )
        return []
    if animated not in _PROPERTIES:
        raise SceneFileError(
            f"{target.at('path')}: must be one of {', '.join(_PROPERTIES)}, got {animated!r:.40}"
        )
    node = target.index("node", len(nodes.nodes), "nodes")
    if node is None:
        return []  # glTF 2.0 section 3.11: a channel without a node is meant for extensions
    if "matrix" in nodes.nodes[node].members:
        raise SceneFileError(f"{target.where}: an animated node must not have a matrix")
    samplers = clip.objects("samplers")
    sampler = samplers[member.required_index("sampler", len(samplers), "samplers")]
    name = sampler.string("interpolation", "LINEAR")
    if name not in _INTERPOLATIONS:
        raise SceneFileError(
            f"{sampler.at('interpolation')}: must be one of {', '.join(_INTERPOLATIONS)}, got {name!r:.40}"
        )
    times = _times(accessors.referred(sampler, "input", ("SCALAR",)), document)
    output = accessors.referred(sampler, "output", (_PROPERTIES[animated],))
    values, tangents = _values(output, len(times), _INTERPOLATIONS[name], animated, document)
    return [Channel(node, animated, _INTERPOLATIONS[name], times, values, tangents, duration=0.0)]


def _times(elements: Elements, document: GltfDocument) -> Float64[np.ndarray, " keys"]:
    document.decoded.spend(8 * len(elements), elements.where)
    times = elements.as_floats().astype(np.float64)[:, 0]
    if times[0] < 0.0 or (np.diff(times) <= 0.0).any():
        raise SceneFileError(f"{elements.where}: times must rise strictly from at least 0")
    return times


def _values(
    elements: Elements, key_count: int, interpolation: Interpolation, animated: str, document: GltfDocument
) -> tuple[Float64[np.ndarray, "keys components"], Float64[np.ndarray, "keys 2 components"] | None]:
    per_key = 3 if interpolation == "cubic_spline" else 1
    if len(elements) != per_key * key_count:
        raise SceneFileError(
            f"{elements.where}: must have {per_key * key_count} elements for {key_count} times, "
            f"got {len(elements)}"
        )
    if elements.stored.dtype.kind != "f" and not elements.normalized:
        raise SceneFileError(f"{elements.where}: must be floats or normalised integers")
    document.decoded.spend(8 * elements.stored.size, elements.where)
    stored = elements.as_floats().astype(np.float64)
    if np.abs(stored).max() > LARGEST_COORDINATE:
        raise SceneFileError(f"{elements.where}: must be at most {LARGEST_COORDINATE:g} in magnitude")
    if per_key == 3:
        in_value_out = stored.reshape(key_count, 3, -1)
        values, tangents = in_value_out[:, 1], in_value_out[:, ::2]
    else:
        values, tangents = stored, None
    if animated == "rotation" and not np.linalg.norm(values, axis=1).all():
        raise SceneFileError(f"{elements.where}: must be unit quaternions, got zero")
    return values, tangents


def _with_ancestors(leaves: Sequence[int], parents: Sequence[int]) -> list[int]:
    """The nodes and all their ancestors, parents before children."""
    order: dict[int, None] = {}
    for leaf in leaves:
        chain = []
        while leaf >= 0 and leaf not in order:
            chain.append(leaf)
            leaf = parents[leaf]
        order.update(dict.fromkeys(reversed(chain)))
    return list(order)


def _rows(nodes: Sequence[int], row_of: dict[int, int]) -> Int32[np.ndarray, " n"]:
    return np.array([row_of[node] for node in nodes], np.int32)


def _rest(node: JsonObject) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A node's local matrix, translation, rotation and scale at rest. They have been checked before."""
    translation = node.numbers("translation", 3, default=(0.0, 0.0, 0.0))
    rotation = node.numbers("rotation", 4, default=(0.0, 0.0, 0.0, 1.0))
    scale = node.numbers("scale", 3, default=(1.0, 1.0, 1.0))
    if "matrix" in node.members:
        return node.numbers("matrix", 16).reshape(4, 4).T, translation, rotation, scale
    return trs_matrices(translation[None], rotation[None], scale[None])[0], translation, rotation, scale
