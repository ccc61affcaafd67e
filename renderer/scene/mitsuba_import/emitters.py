"""Mitsuba's emitters approximated by punctual lights of the same radiant flux.

A one-sided area emitter of radiance L and area A emits the flux π·A·L with a cosine distribution. A spot with
an outer cone of 90° and an inner cone of 0 falls off as cos² (KHR_lights_punctual), which integrates to 2π/3
over the hemisphere. So a spot of intensity 3/2·A·L has the same flux, slightly more concentrated along the
normal. An emitter that faces all directions, such as a sphere, becomes a point light of intensity A·L/4.
"""

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from jaxtyping import Float64

from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin
from vpltune.renderer.scene.scene import Light, Mesh, cofactor_matrix
from vpltune.renderer.scene.spot_cone import checked_cone

# A choice: an emitter faces one direction if the vector sum of its triangles' areas is at least this share
# of its area.
_FACES_ONE_WAY = 0.9
# A choice: distance of a spot from its emitting surface in units of √area, enough to clear rounding.
_LIFT = 1e-3
# A choice: half angle of the part of an environment that becomes one directional light, radians.
_SUN_CONE = math.radians(30.0)
# A choice: rows of the coarse map in which the brightest part of an environment is searched; 7.5° each.
_COARSE_ROWS = 24
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
    emitter: Plugin, facets: Facets, to_world: Float64[np.ndarray, "4 4"], outwards: float
) -> AreaEmitter | None:
    """The punctual light that replaces an area emitter; None if the emitter is black or has no area.

    Args:
        emitter: the plugin, whose `radiance` is in W/(m²·sr).
        facets: of the shape.
        to_world: places them.
        outwards: 1 if light leaves the side on which the triangles wind counter-clockwise, −1 for the other.

    Raises:
        SceneFileError: the radiance is textured or not a colour.
    """
    radiance = _radiance(emitter)
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
            return _environment(emitter, folder, across, warnings)
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


def _radiance(emitter: Plugin) -> Float64[np.ndarray, "3"]:
    if emitter.child("radiance") is not None:
        raise SceneFileError(f"{emitter.where}: a textured radiance is not supported")
    return emitter.vector("radiance", (1.0, 1.0, 1.0))


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
        "spot", intensity, to_world[:3, 3], _unit(to_world[:3, 2], emitter), inner, outer, name="spot"
    )
    return light, 2.0 * math.pi * (1.0 - math.cos((inner + outer) / 2.0)) * float(intensity.mean())


def _directional(emitter: Plugin) -> Light:
    direction = emitter.to_world()[:3, 2]
    if "direction" in emitter.values:
        direction = emitter.vector("direction", (0.0, 0.0, 1.0))
    irradiance = emitter.vector("irradiance", (1.0, 1.0, 1.0))
    return Light("directional", irradiance, direction_world=_unit(direction, emitter), name="directional")


def _environment(
    emitter: Plugin, folder: SceneFolder, across: float, warnings: Warnings
) -> tuple[Light, float] | None:
    """A directional light with the light vector of the brightest part of the environment.

    The light vector (Gershun 1939) is the net irradiance through a surface perpendicular to it. That of the
    whole environment would point between a low sun and the zenith, where rooms have ceilings.
    """
    name = emitter.text("filename")
    try:
        content = folder.read(name, emitter.where)
    except SceneFileError as error:
        warnings.add(f"the environment {name!r:.80} is ignored: {error}")
        return None
    if not name.lower().endswith(".exr"):
        warnings.add(f"the environment {name!r:.80} is ignored: only .exr images are supported")
        return None
    pixels = _exr_pixels(content, f"{emitter.where}: {name!r:.80}") * emitter.number("scale", 1.0)
    directions, flux = _coarse_sky(pixels)
    inside = directions @ directions.T > math.cos(_SUN_CONE)
    # [cone, axis, channel]
    vectors = np.einsum("cd,da,dr->car", inside.astype(np.float64), directions, flux)
    strength = np.linalg.norm(vectors.mean(axis=2), axis=1)
    total = float(flux.sum(axis=0).mean())
    brightest = int(strength.argmax())
    share = float(strength[brightest]) / total if total > 0.0 else 0.0
    # No main direction: the brightest cone has less than 1.5 times its share of a uniform environment.
    if share < 1.5 * (1.0 - math.cos(_SUN_CONE)) / 2.0:
        warnings.add(
            f"the environment {name!r:.80} is ignored: it lights from all directions, which no punctual "
            "light can represent"
        )
        return None
    towards = vectors[brightest].mean(axis=1)
    unit = towards / np.linalg.norm(towards)
    irradiance = np.maximum(unit @ vectors[brightest], 0.0)
    direction = _unit(-(emitter.to_world()[:3, :3] @ unit), emitter)
    warnings.add(
        f"the environment {name!r:.80} becomes one directional light, which represents its brightest "
        f"{math.degrees(2 * _SUN_CONE):.0f}° and {share:.0%} of its light"
    )
    light = Light("directional", irradiance, direction_world=direction, name="environment")
    return light, across * float(irradiance.mean())


def _coarse_sky(
    pixels: Float64[np.ndarray, "rows columns 3"],
) -> tuple[Float64[np.ndarray, "cells 3"], Float64[np.ndarray, "cells 3"]]:
    """Unit directions of the cells of a coarse map, and the integral of radiance over each cell."""
    rows, columns, _ = pixels.shape
    azimuth = 2.0 * np.pi * (np.arange(columns) + 0.5) / columns
    polar = np.pi * (np.arange(rows) + 0.5) / rows
    weighted = pixels * (2.0 * np.pi / columns * np.pi / rows * np.sin(polar)[:, None, None])
    # Mitsuba measures azimuth from −Z towards +X, and the polar angle from +Y.
    sine, cosine = np.sin(polar)[:, None], np.cos(polar)[:, None]
    directions = np.stack(
        np.broadcast_arrays(sine * np.sin(azimuth), cosine, -sine * np.cos(azimuth)), axis=-1
    )
    row = np.arange(rows) * min(rows, _COARSE_ROWS) // rows
    column = np.arange(columns) * min(columns, 2 * _COARSE_ROWS) // columns
    cell = (row[:, None] * 2 * _COARSE_ROWS + column).ravel()
    count = 2 * _COARSE_ROWS**2

    def summed(values: np.ndarray) -> Float64[np.ndarray, "cells 3"]:
        return np.stack([np.bincount(cell, values[..., i].ravel(), count) for i in range(3)], axis=-1)

    middle = summed(directions)
    length = np.linalg.norm(middle, axis=1)
    used = length > 0.0
    return middle[used] / length[used, None], summed(weighted)[used]


def _exr_pixels(content: bytes, where: str) -> Float64[np.ndarray, "height width 3"]:
    # OpenEXR can only read from a file.
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "environment.exr"
        copy.write_bytes(content)
        try:
            channels = OpenEXR.File(str(copy)).channels()
        except Exception as error:  # OpenEXR raises many types, none of its own
            raise SceneFileError(f"{where}: is not an OpenEXR image ({error})") from error
        if "RGB" in channels or "RGBA" in channels:
            pixels = (channels.get("RGB") or channels["RGBA"]).pixels[..., :3]
        elif all(name in channels for name in "RGB"):
            pixels = np.stack([channels[name].pixels for name in "RGB"], axis=-1)
        else:
            raise SceneFileError(f"{where}: must have channels R, G and B, got {', '.join(sorted(channels))}")
        pixels = pixels.astype(np.float64)
    if not (np.isfinite(pixels).all() and (pixels >= 0.0).all()):
        raise SceneFileError(f"{where}: radiance must be finite and ≥ 0")
    return pixels


def _unit(vector: Float64[np.ndarray, "3"], emitter: Plugin) -> Float64[np.ndarray, "3"]:
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise SceneFileError(f"{emitter.where}: its direction must not be zero")
    return vector / length
