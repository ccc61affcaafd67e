"""Mitsuba's emitters approximated by punctual lights of the same radiant flux.

A one-sided area emitter of radiance L and area A emits the flux π·A·L with a cosine distribution. A spot with
an outer cone of 90° and an inner cone of 0 falls off as cos² (KHR_lights_punctual), which integrates to 2π/3
over the hemisphere. So a spot of intensity 3/2·A·L has the same flux, slightly more concentrated along the
normal. An emitter that faces all directions, such as a sphere, becomes a point light of intensity A·L/4.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.mitsuba_import.environment_map import environment_light
from vpltune.renderer.scene.mitsuba_import.materials import MaterialReader, texture_name
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin
from vpltune.renderer.scene.mitsuba_import.values import unit_direction
from vpltune.renderer.scene.scene import Light, Mesh
from vpltune.renderer.scene.spot_cone import checked_cone
from vpltune.renderer.scene.transforms import cofactor_matrix

# A choice: an emitter faces one direction if the vector sum of its triangles' areas is at least this share
# of its area.
_FACES_ONE_WAY = 0.9
# A choice: distance of a spot from its emitting surface in units of √area, enough to clear rounding.
_LIFT = 1e-3
# A choice: most lights kept.
MOST_LIGHTS = 8
# A choice: the weakest lights are left out if together they carry at most this share of the total flux.
_LEAST_SHARE = 0.01


@dataclass(frozen=True, eq=False)
class AreaEmitter:
    """The punctual light that replaces an emitting shape."""

    light: Light
    flux: float
    """Radiant flux in W, mean of the channels."""
    hides_itself: bool
    """Whether the shape's own surface encloses the light, and so must be removed."""


@dataclass(frozen=True, eq=False)
class Facets:
    """What area emitters need of a mesh, in its own space."""

    vectors: Float64[np.ndarray, "3 triangles"]
    """Normals as long as the triangles are large, on the side where these wind counter-clockwise."""
    centers: Float64[np.ndarray, "3 triangles"]
    net: Float64[np.ndarray, "3"]
    """The sum of the vectors."""


def mesh_facets(mesh: Mesh) -> Facets:
    """The facets of a mesh."""
    first, second, third = (mesh.positions[mesh.triangles[:, i]].astype(np.float64) for i in range(3))
    vectors = 0.5 * np.cross(second - first, third - first)
    centers = (first + second + third) / 3.0
    return Facets(np.ascontiguousarray(vectors.T), np.ascontiguousarray(centers.T), vectors.sum(axis=0))


def area_emitter(
    radiance: Float64[np.ndarray, "3"],
    facets: Facets,
    to_world: Float64[np.ndarray, "4 4"],
    outwards: float,
) -> AreaEmitter | None:
    """The punctual light that replaces an area emitter; None if the emitter is black or has no area.

    Args:
        radiance: in W/(m²·sr).
        facets: of the shape.
        to_world: places them.
        outwards: 1 if light leaves the side on which the triangles wind counter-clockwise, −1 for the other.
    """
    to_vector = cofactor_matrix(to_world)
    vectors = to_vector @ facets.vectors
    areas = np.sqrt(np.einsum("at,at->t", vectors, vectors))
    area = float(areas.sum())
    if not (area > 0.0 and radiance.any()):
        return None
    center = to_world[:3, :3] @ (facets.centers @ areas / area) + to_world[:3, 3]
    net = outwards * (to_vector @ facets.net)
    facing = float(np.linalg.norm(net))
    flux = math.pi * area * float(radiance.mean())
    if facing < _FACES_ONE_WAY * area:
        light = Light("point", radiance * (area / 4.0), center, name="area emitter")
        return AreaEmitter(light, flux, True)
    direction = net / facing
    position = center + direction * (_LIFT * math.sqrt(area))
    light = Light(
        "spot", radiance * (1.5 * area), position, direction, 0.0, math.pi / 2.0, name="area emitter"
    )
    return AreaEmitter(light, flux, False)


def punctual_light(
    emitter: Plugin, folder: SceneFolder, extent: float, warnings: Warnings
) -> tuple[Light, float] | None:
    """The punctual light for an emitter that is not a shape, and its flux in W, mean of the channels.

    Args:
        emitter: the plugin.
        folder: the folder from which an environment map is read.
        extent: diagonal of the scene in world units, for the flux of directional lights.
        warnings: takes a line for each approximation.

    Returns:
        None if the emitter is black or no punctual light can represent it.

    Raises:
        SceneFileError: the emitter type is unsupported, a value is invalid, or a file cannot be read.
    """
    across = math.pi * (extent / 2.0) ** 2
    match emitter.type:
        case "point":
            intensity = emitter.vector("intensity", (1.0, 1.0, 1.0))
            light = Light("point", intensity, _position(emitter), name="point")
            flux = 4.0 * math.pi * float(intensity.mean())
        case "spot":
            light, flux = _spot(emitter, warnings)
        case "directional":
            light = _directional(emitter)
            flux = across * float(light.intensity.mean())
        case "envmap":
            return environment_light(emitter, folder, across, warnings)
        case "constant":
            warnings.add(
                "the constant environment is ignored: it lights from all directions, which no punctual light "
                "can represent"
            )
            return None
        case _:
            raise SceneFileError(f"{emitter.where}: unsupported emitter type")
    return (light, flux) if light.intensity.any() else None


def strongest(lights: list[tuple[Light, float]], warnings: Warnings) -> tuple[Light, ...]:
    """At most `MOST_LIGHTS` of the strongest lights, without the weakest that carry 1 % of the flux.

    The order of the lights is kept.

    Args:
        lights: each with its flux in W.
        warnings: takes a line if lights are left out.
    """
    order = sorted(range(len(lights)), key=lambda i: -lights[i][1])
    total = sum(flux for _, flux in lights)
    kept: list[int] = []
    carried = 0.0
    for index in order:
        if len(kept) == MOST_LIGHTS or carried >= (1.0 - _LEAST_SHARE) * total:
            break
        kept.append(index)
        carried += lights[index][1]
    left_out = len(lights) - len(kept)
    if left_out:
        warnings.add(
            f"{left_out} of {len(lights)} lights are left out, with {1.0 - carried / total:.1%} of the flux"
        )
    return tuple(lights[index][0] for index in sorted(kept))


def area_radiance(emitter: Plugin, materials: MaterialReader, warnings: Warnings) -> Float64[np.ndarray, "3"]:
    """The radiance of an area emitter in W/(m²·sr); of a textured one, the mean of its texture.

    Args:
        emitter: the plugin.
        materials: reads textures.
        warnings: takes a line for a texture.

    Raises:
        SceneFileError: the radiance is not a colour, or its texture cannot be read.
    """
    texture = emitter.child("radiance")
    if texture is None:
        return emitter.vector("radiance", (1.0, 1.0, 1.0))
    if texture.kind != "texture":
        raise SceneFileError(f"{emitter.where}: 'radiance' must be a colour or a texture")
    mean = materials.mean_color(texture)
    shown = ", ".join(f"{channel:.3g}" for channel in mean)
    warnings.add(
        f"the radiance of an area emitter is the texture {texture_name(texture)}: its mean, {shown} "
        "W/(m²·sr), is used all over"
    )
    return mean


def _position(emitter: Plugin) -> Float64[np.ndarray, "3"]:
    if "position" in emitter.values:
        return emitter.vector("position", (0.0, 0.0, 0.0))
    return emitter.to_world()[:3, 3]


def _spot(emitter: Plugin, warnings: Warnings) -> tuple[Light, float]:
    cutoff = emitter.number("cutoff_angle", 20.0)
    beam = emitter.number("beam_width", 0.75 * cutoff)
    inner, outer = checked_cone(
        beam, cutoff, "degrees", emitter.where, ("beam_width", "cutoff_angle"), 180.0, SceneFileError
    )
    if cutoff > 90.0:
        warnings.tally(
            "1 spot shines wider than 90° from its axis; it ends there",
            "{n} spots shine wider than 90° from their axes; they end there",
        )
    if min(beam, 90.0) == min(cutoff, 90.0):
        warnings.tally("1 spot has a hard edge", "{n} spots have hard edges")
    warnings.tally(
        "1 spot falls off between its two angles as in glTF, not linearly with the angle as in Mitsuba",
        "{n} spots fall off between their two angles as in glTF, not linearly with the angle as in Mitsuba",
    )
    to_world = emitter.to_world()
    intensity = emitter.vector("intensity", (1.0, 1.0, 1.0))
    light = Light(
        "spot",
        intensity,
        to_world[:3, 3],
        unit_direction(to_world[:3, 2], emitter.where),
        inner,
        outer,
        name="spot",
    )
    return light, 2.0 * math.pi * (1.0 - math.cos((inner + outer) / 2.0)) * float(intensity.mean())


def _directional(emitter: Plugin) -> Light:
    direction = emitter.to_world()[:3, 2]
    if "direction" in emitter.values:
        direction = emitter.vector("direction", (0.0, 0.0, 1.0))
    irradiance = emitter.vector("irradiance", (1.0, 1.0, 1.0))
    return Light(
        "directional",
        irradiance,
        direction_world=unit_direction(direction, emitter.where),
        name="directional",
    )
