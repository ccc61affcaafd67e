"""What VPLs see, from their visibility maps, in JAX: the twin of shaders/common/vpl_visibility.glsl."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from renderer.artist_parameters import ArtistParameters
from renderer.capture import CapturedFrame
from tuner.virtual_point_lights import Receivers, VirtualPointLights

VISIBILITY_LIFT = 0.01
"""Footprints by which a map's origin is lifted off the VPL's surface; twin of the shader's constant."""
VISIBILITY_NEAREST = 0.5
VISIBILITY_FARTHEST = 1.5
"""Shares of the receiver's distance at which a texel's axis may meet its plane; twins of the shader's."""
CHUNK = 128
"""Receivers at once: 128 × 1,024 pairs with four texels each are 2 MiB an array."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class VisibilityParameters:
    """bias: share of the distance by which a blocker must stand before the receiver's plane. softness: share
    of the distance over which light fades in."""

    bias: Float[Array, ""]
    softness: Float[Array, ""]


def hemi_octahedral_encode(direction: Float[Array, "*n 3"]) -> Float[Array, "*n 2"]:
    """Unit vectors of the upper hemisphere on [-1, 1]² (Cigolle et al. 2014, "hemi-oct"). Twin in GLSL."""
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
    s = jnp.where(z >= 0.0, 1.0, -1.0)
    a = -1.0 / (s + z)
    b = x * y * a
    tangent = jnp.stack([1.0 + s * x * x * a, s * b, -s * x], axis=-1)
    bitangent = jnp.stack([b, s + y * y * a, -y], axis=-1)
    return jnp.stack([tangent, bitangent, normal], axis=1)


def map_visibility(
    captured: CapturedFrame, receivers: Receivers, vpls: VirtualPointLights, parameters: ArtistParameters
) -> Float[Array, "receivers vpls"] | None:
    """What the runtime takes the visibility to be: from the frame's maps, or None where it has none."""
    if captured.visibility_maps is None:
        return None
    chosen = VisibilityParameters(
        jnp.float32(parameters.visibility_bias), jnp.float32(parameters.visibility_softness)
    )
    return vpl_visibility(receivers, vpls, jnp.asarray(captured.visibility_maps), chosen)


@jax.jit
def vpl_visibility(
    receivers: Receivers,
    vpls: VirtualPointLights,
    maps: Float[Array, "vpls size size"],
    parameters: VisibilityParameters,
) -> Float[Array, "receivers vpls"]:
    """Share of each VPL's light that reaches each receiver, in [0, 1]. Twin: `vpl_visibility` in GLSL.

    The four texels around the receiver's direction are compared each along its own axis with the receiver's
    tangent plane, so that a coarse map does not shade the plane it shows (receiver plane depth bias, Isidoro
    2006); an axis that misses the plane, with the receiver's distance.

    Args:
        receivers, vpls, maps: lengths in units of L.
    """
    size = maps.shape[1]
    frame = hemisphere_frame(vpls.normal)
    origin = vpls.position + VISIBILITY_LIFT * vpls.footprint[:, None] * vpls.normal
    centers = (jnp.arange(size) + 0.5) * (2.0 / size) - 1.0
    axes = hemi_octahedral_decode(jnp.stack(jnp.meshgrid(centers, centers), axis=-1)).reshape(-1, 3)
    flat = maps.reshape(-1)
    first = jnp.arange(len(vpls.position)) * size * size

    def chunk(inputs: tuple[Array, Array]) -> Array:
        position, normal = inputs
        to_receiver = position[:, None, :] - origin[None, :, :]
        direction = jnp.einsum("rvk,vak->rva", to_receiver, frame, precision="highest")
        normal_vpl = jnp.einsum("rk,vak->rva", normal, frame, precision="highest")
        plane = (to_receiver * normal[:, None, :]).sum(-1)
        distance = jnp.maximum(jnp.linalg.norm(to_receiver, axis=-1), 1e-9)
        asked = (direction[..., 2] > 0.0) & (plane < 0.0)
        # Where not asked, any finite direction serves.
        direction = jnp.where(asked[..., None], direction, jnp.array([0.0, 0.0, 1.0]))
        place = (hemi_octahedral_encode(direction) * 0.5 + 0.5) * size - 0.5
        corner = jnp.floor(place)
        blend = place - corner
        visible = weights = 0.0
        for i in range(4):
            step = jnp.array([i & 1, i >> 1])
            texel = jnp.clip(corner.astype(jnp.int32) + step, 0, size - 1)
            index = texel[..., 1] * size + texel[..., 0]
            slope = (axes[index] * normal_vpl).sum(-1)
            share = jnp.prod(jnp.where(step == 1, blend, 1.0 - blend), axis=-1)
            meets = slope < -1e-4
            reach = jnp.where(meets, plane / (jnp.where(meets, slope, -1.0) * distance), 1.0)
            share = jnp.where(reach > VISIBILITY_NEAREST, share, 0.0)
            lead = flat[first + index] / (distance * jnp.minimum(reach, VISIBILITY_FARTHEST))
            lead = lead - 1.0 + parameters.bias
            visible += share * jnp.clip(lead / parameters.softness + 0.5, 0.0, 1.0)
            weights += share
        seen = jnp.where(weights > 1e-4, visible / jnp.maximum(weights, 1e-4), 1.0)
        return jnp.where(asked, seen, 1.0)

    count = receivers.position.shape[0]
    padding = ((0, -count % CHUNK), (0, 0))
    inputs = tuple(
        jnp.pad(values, padding).reshape(-1, CHUNK, 3) for values in (receivers.position, receivers.normal)
    )
    return jax.lax.map(chunk, inputs).reshape(-1, len(vpls.position))[:count]
