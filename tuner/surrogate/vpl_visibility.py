"""VPL visibility from visibility maps, in JAX. Twin: shaders/common/vpl_visibility.glsl."""

from dataclasses import dataclass, field
from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.capture import CapturedFrame, VisibilityMaps
from vpltune.renderer.frame.visibility_map_layout import (
    FRAME_TURNS_OVER,
    SHEET_BEND,
    SHEET_COSINE,
    SHEET_TILT,
    VISIBILITY_FIRST_VERTEX,
    VISIBILITY_LIFT,
    VISIBILITY_ROUNDING,
)
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights

CHUNK = 128
"""Receivers in one chunk. A choice: with 1,024 VPLs, one value for each pair takes half a MiB."""
_Vectors = Float[Array, "receivers vpls 3"]
_PADDINGS = 4
"""The fine texels are padded in steps of 1/`_PADDINGS` of the number of coarse texels. A choice."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class VisibilityParameters:
    """The parameters of the visibility test, as shares of the distance between map and receiver."""

    bias: Float[Array, ""]
    """β: an overlap of up to this casts no shadow."""
    softness: Float[Array, ""]
    """σ: beyond the bias, light fades to zero over this overlap."""

    @classmethod
    def of(cls, parameters: ArtistParameters) -> "VisibilityParameters":
        """The visibility parameters of a config."""
        return cls(jnp.float32(parameters.visibility_bias), jnp.float32(parameters.visibility_softness))


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class MapTexels:
    """Coarse texels, VPL by VPL and row by row, then the fine texels of all blocks; in each VPL's frame."""

    end: Float[Array, "texels 3"]
    """End of the ray, relative to the map's origin [L]."""
    normal: Float[Array, "texels 3"]
    """Normal of the surface that the ray hit."""
    corner: Int[Array, "vpls size size"]
    """Corner marks, 0 for none: shaders/common/vpl_visibility.glsl."""
    block_start: Int[Array, "vpls size size"]
    """Index of the first fine texel in the block of this coarse texel; -1 if it has none."""
    refinement: int = field(metadata={"static": True})
    """Fine texels along the side of a block."""


def hemi_octahedral_encode(direction: Float[Array, "*n 3"]) -> Float[Array, "*n 2"]:
    """Unit vectors of the upper hemisphere to [-1, 1]² (Cigolle et al. 2014, "hemi-oct"). Twin in GLSL."""
    p = direction[..., :2] / (jnp.abs(direction[..., :2]).sum(-1, keepdims=True) + direction[..., 2:])
    return jnp.stack([p[..., 0] + p[..., 1], p[..., 0] - p[..., 1]], axis=-1)


def hemi_octahedral_decode(encoded: Float[Array, "*n 2"]) -> Float[Array, "*n 3"]:
    """The inverse of `hemi_octahedral_encode`. Twin in GLSL."""
    x = (encoded[..., 0] + encoded[..., 1]) / 2.0
    y = (encoded[..., 0] - encoded[..., 1]) / 2.0
    direction = jnp.stack([x, y, 1.0 - jnp.abs(x) - jnp.abs(y)], axis=-1)
    return direction / jnp.linalg.norm(direction, axis=-1, keepdims=True)


def hemisphere_frame(normal: Float[Array, "vpls 3"]) -> Float[Array, "vpls 3 3"]:
    """Rows: two tangents and the normal, right-handed (Duff et al. 2017). Twin in GLSL."""
    x, y, z = normal[:, 0], normal[:, 1], normal[:, 2]
    s = jnp.where(z >= FRAME_TURNS_OVER, 1.0, -1.0)
    a = -1.0 / (s + z)
    b = x * y * a
    tangent = jnp.stack([1.0 + s * x * x * a, s * b, -s * x], axis=-1)
    bitangent = jnp.stack([b, s + y * y * a, -y], axis=-1)
    return jnp.stack([tangent, bitangent, normal], axis=1)


def map_texels(maps: VisibilityMaps) -> MapTexels:
    """Convert the maps of a frame to the form that `vpl_visibility` takes."""
    size, refinement = maps.distance.shape[1], maps.block_distance.shape[1]
    end = _axes(size)[None] * maps.distance[..., None]
    _, row, column = np.nonzero(maps.block >= 0)
    inside = np.arange(refinement)
    fine_row = (row[:, None] * refinement + inside)[:, :, None]
    fine_column = (column[:, None] * refinement + inside)[:, None, :]
    block_end = _axes(size * refinement)[fine_row, fine_column] * maps.block_distance[..., None]
    # The number of blocks varies between frames. Pad it to one of a few sizes, so that little is recompiled.
    padding = ((0, -block_end.size // 3 % (1 + maps.distance.size // _PADDINGS)), (0, 0))
    return MapTexels(
        _joined(end, np.pad(block_end.reshape(-1, 3), padding)),
        _joined(maps.normal, np.pad(maps.block_normal.reshape(-1, 3), padding)),
        jnp.asarray(maps.corner),
        jnp.where(maps.block >= 0, maps.distance.size + maps.block * refinement**2, -1),
        refinement,
    )


@lru_cache
def _axes(size: int) -> Float32[np.ndarray, "size size 3"]:
    """Directions of the texels of a map. Twin: `visibility_axis` in GLSL."""
    # This is `hemi_octahedral_decode` in numpy: outside of `jit`, JAX would compile each operation
    # separately.
    centers = (np.arange(size, dtype=np.float32) + np.float32(0.5)) * np.float32(2.0 / size) - np.float32(1.0)
    u, v = np.meshgrid(centers, centers)
    x, y = (u + v) / 2.0, (u - v) / 2.0
    direction = np.stack([x, y, 1.0 - np.abs(x) - np.abs(y)], axis=-1)
    return (direction / np.linalg.norm(direction, axis=-1, keepdims=True)).astype(np.float32)


def _joined(
    texels: Float32[np.ndarray, "vpls size size 3"], details: Float32[np.ndarray, "n 3"]
) -> Float[Array, "texels 3"]:
    return jnp.concatenate([texels.reshape(-1, 3), details])


def map_visibility(
    captured: CapturedFrame, receivers: Receivers, vpls: VirtualPointLights, parameters: ArtistParameters
) -> Float[Array, "receivers vpls"] | None:
    """The visibility in the runtime's frame, in [0, 1], from its visibility maps; None if it has no maps."""
    if captured.visibility_maps is None:
        return None
    texels = map_texels(captured.visibility_maps)
    return vpl_visibility(receivers, vpls, texels, VisibilityParameters.of(parameters))


@jax.jit
def vpl_visibility(
    receivers: Receivers, vpls: VirtualPointLights, texels: MapTexels, parameters: VisibilityParameters
) -> Float[Array, "receivers vpls"]:
    """Share of each VPL's light that reaches each receiver, in [0, 1]. Twin: `vpl_visibility` in GLSL."""
    return seen_share(surface_overlap(receivers, vpls, texels), parameters)


def seen_share(overlap: Float[Array, "*shape"], parameters: VisibilityParameters) -> Float[Array, "*shape"]:
    """Share of the light that passes a surface with this overlap: 1 − clamp((overlap − β)/σ, 0, 1)."""
    return 1.0 - jnp.clip((overlap - parameters.bias) / parameters.softness, 0.0, 1.0)


def visibility_origin(vpls: VirtualPointLights) -> Float[Array, "vpls 3"]:
    """Origin of the rays of each VPL's map [L]. Twin in GLSL."""
    return vpls.position + VISIBILITY_LIFT * vpls.footprint[:, None] * vpls.normal


@jax.jit
def surface_overlap(
    receivers: Receivers, vpls: VirtualPointLights, texels: MapTexels
) -> Float[Array, "receivers vpls"]:
    """Overlap of each receiver with the surface that each VPL sees towards it, as a share of the distance.

    For a receiver that faces the VPL's middle it is the lesser of two heights: of the hit above the
    receiver's tangent plane (receiver plane depth bias, Isidoro 2006), and of the receiver behind the hit's.
    Otherwise it is that of the disc's rim (`rim_overlap` in GLSL). At a corner mark, the planes of three
    texels around count too (`joined_overlap`). It is negative if nothing is in between, and -1 below the
    VPL's horizon.

    Args:
        receivers: Receivers, in units of L.
        vpls: VPLs, in units of L.
        texels: The maps of the VPLs.
    """
    lookup = _Lookup(texels)
    frame = hemisphere_frame(vpls.normal)
    origin = visibility_origin(vpls)

    def chunk(inputs: tuple[Array, Array]) -> Array:
        position, normal_world = inputs
        in_frame = partial(jnp.einsum, "rvk,vak->rva", precision="highest")
        receiver = in_frame(position[:, None, :] - origin[None, :, :], frame)
        normal = jnp.einsum("rk,vak->rva", normal_world, frame, precision="highest")
        above = receiver[..., 2] > 0.0
        # Pairs that exchange no light get any finite direction.
        receiver = jnp.where(above[..., None], receiver, jnp.array([0.0, 0.0, 1.0]))
        return jnp.where(above, lookup.overlap(receiver, normal), -1.0)

    count = receivers.position.shape[0]
    padding = ((0, -count % CHUNK), (0, 0))
    inputs = tuple(
        jnp.pad(values, padding).reshape(-1, CHUNK, 3) for values in (receivers.position, receivers.normal)
    )
    return jax.lax.map(chunk, inputs).reshape(-1, len(vpls.position))[:count]


class _Lookup:
    """The lookup in the maps of all VPLs. Places are in units of a map's finest texels."""

    def __init__(self, texels: MapTexels):
        self._texels = texels
        self._size, self._refinement = texels.block_start.shape[1], texels.refinement
        self._finest = self._size * self._refinement
        self._first = jnp.arange(texels.block_start.shape[0]) * self._size**2
        self._corner, self._block_start = texels.corner.reshape(-1), texels.block_start.reshape(-1)

    def overlap(self, receiver: _Vectors, normal: _Vectors) -> Float[Array, "receivers vpls"]:
        """Overlap of receivers with what the map has in their direction; both in each VPL's frame."""
        place = (hemi_octahedral_encode(receiver) * 0.5 + 0.5) * self._finest
        place = jnp.minimum(place, self._finest - 0.5)
        own_place = place.astype(jnp.int32)
        coarse, end, met_normal = self._met(own_place)
        distance = jnp.linalg.norm(receiver, axis=-1)
        away = _dot(receiver, normal)
        flat = normal * jnp.array([1.0, 1.0, 0.0])
        cut = flat * (away / jnp.maximum(_dot(flat, flat), 1e-12))[..., None]

        def shows_its_back(other: Array, other_normal: Array) -> Array:
            between = other - receiver
            apart = jnp.linalg.norm(between, axis=-1)
            rounding = VISIBILITY_ROUNDING * (distance + jnp.linalg.norm(other, axis=-1))
            return (
                (_dot(other_normal, normal) < SHEET_COSINE)
                & (_dot(between, other_normal) > -SHEET_BEND * apart - rounding)
                & (_dot(between, normal) > -SHEET_TILT * apart - rounding)
            )

        def rim(other: Array, other_normal: Array) -> Array:
            return jnp.minimum(_dot(other - receiver, other_normal), _dot(other - cut, other_normal))

        def corner(other: Array, other_normal: Array) -> Array:
            between = other - receiver
            reaches = _dot(between, normal) > -VISIBILITY_ROUNDING * distance
            hidden = jnp.where(reaches, _dot(between, other_normal), -distance)
            overlap = jnp.where(away < 0.0, hidden, rim(other, other_normal))
            return jnp.where(shows_its_back(other, other_normal), distance, overlap)

        before, behind = _dot(end - receiver, normal), _dot(end - receiver, met_normal)
        overlap = jnp.where(away < 0.0, jnp.minimum(before, behind), rim(end, met_normal))
        overlap = jnp.where(shows_its_back(end, met_normal), distance, overlap)
        ends, normals = [end], [met_normal]
        for around in self._around(place, own_place, coarse):
            on_map = ((around >= 0) & (around < self._finest)).all(-1)[..., None]
            _, other, other_normal = self._met(jnp.clip(around, 0, self._finest - 1))
            ends.append(jnp.where(on_map, other, end))
            normals.append(jnp.where(on_map, other_normal, met_normal))
        lengths = [jnp.linalg.norm(each, axis=-1) for each in ends]

        def is_behind(i: int, j: int) -> Array:
            return _dot(ends[i] - ends[j], normals[j]) < -VISIBILITY_ROUNDING * (lengths[i] + lengths[j])

        for i in range(4):
            counts = (self._corner[coarse] > 0) & ~is_behind(i, 0)
            for j in range(4):
                counts = counts & ~is_behind(j, i)
            overlap = jnp.where(counts, jnp.maximum(overlap, corner(ends[i], normals[i])), overlap)
        return overlap / distance

    def _met(self, place: Array) -> tuple[Array, Array, Array]:
        """Index of the coarse texel at a place; the end of the ray there, and the normal that it met."""
        texel = place // self._refinement
        coarse = self._first + texel[..., 1] * self._size + texel[..., 0]
        within = place % self._refinement
        block = self._block_start[coarse]
        index = jnp.where(block >= 0, block + within[..., 1] * self._refinement + within[..., 0], coarse)
        return coarse, self._texels.end[index], self._texels.normal[index]

    def _around(self, place: Array, own_place: Array, coarse: Array) -> list[Array]:
        """Places in three texels around the own one: across a side, another side, and the vertex between."""
        side = jnp.where(self._block_start[coarse] >= 0, 1, self._refinement)[..., None]
        start = own_place // side * side
        vertex = self._corner[coarse][..., None] - VISIBILITY_FIRST_VERTEX
        across = jnp.concatenate([vertex & 1, vertex >> 1], axis=-1) > 0
        beyond = jnp.where(vertex >= 0, across, 2.0 * place >= 2 * start + side)
        beside = jnp.where(beyond, start + side, start - 1)
        return [
            jnp.stack([(beside if x else own_place)[..., 0], (beside if y else own_place)[..., 1]], axis=-1)
            for x, y in ((1, 0), (0, 1), (1, 1))
        ]


def _dot(a: _Vectors, b: _Vectors) -> Float[Array, "receivers vpls"]:
    return (a * b).sum(-1)
