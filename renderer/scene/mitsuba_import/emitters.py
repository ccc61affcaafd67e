"""Mitsuba's emitters: punctual lights, and the emission of shapes."""

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.limits import LARGEST_RADIOMETRIC
from vpltune.renderer.scene.mitsuba_import.materials import AreaEmission, MaterialReader
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin
from vpltune.renderer.scene.mitsuba_import.texture_plugins import texture_name
from vpltune.renderer.scene.mitsuba_import.values import unit_direction
from vpltune.renderer.scene.scene import Light
from vpltune.renderer.scene.spot_cone import checked_cone


def punctual_light(emitter: Plugin, warnings: Warnings) -> Light | None:
    """The punctual light for an emitter that is neither a shape nor an environment; None if it is black.

    Args:
        emitter: the plugin.
        warnings: takes a line for each approximation.

    Raises:
        SceneFileError: the emitter type is unsupported, or a value is invalid.
    """
    match emitter.type:
        case "point":
            intensity = emitter.vector("intensity", (1.0, 1.0, 1.0))
            light = Light("point", intensity, _position(emitter), name="point")
        case "spot":
            light = _spot(emitter, warnings)
        case "directional":
            light = _directional(emitter)
        case _:
            raise SceneFileError(f"{emitter.where}: unsupported emitter type")
    return light if light.intensity.any() else None


def area_emission(emitter: Plugin, materials: MaterialReader, warnings: Warnings) -> AreaEmission | None:
    """The emission of an area emitter; None if it is black.

    Args:
        emitter: the plugin.
        materials: reads textures.
        warnings: takes a line for a texture that counts by its mean.

    Raises:
        SceneFileError: the radiance is not a colour, is negative or too large, or its texture cannot be read.
    """
    child = emitter.child("radiance")
    texture, to_uv = None, np.eye(3)
    if child is None:
        radiance = emitter.vector("radiance", (1.0, 1.0, 1.0))
    elif child.kind != "texture":
        raise SceneFileError(f"{emitter.where}: 'radiance' must be a colour or a texture")
    else:
        bitmap = materials.emission_texture(child)
        if bitmap is not None:
            radiance, texture, to_uv = bitmap
        else:
            radiance = materials.mean_color(child)
            shown = ", ".join(f"{channel:.3g}" for channel in radiance)
            warnings.add(
                f"the radiance of an area emitter is the texture {texture_name(child)}: its mean, {shown} "
                "W/(m²·sr), is used all over"
            )
    if not ((radiance >= 0.0).all() and radiance.max() <= LARGEST_RADIOMETRIC):
        raise SceneFileError(
            f"{emitter.where}: radiance must be from 0 to {LARGEST_RADIOMETRIC:g}, got {radiance.tolist()}"
        )
    red, green, blue = radiance.tolist()
    return AreaEmission((red, green, blue), texture, to_uv) if radiance.any() else None


def _position(emitter: Plugin) -> Float64[np.ndarray, "3"]:
    if "position" in emitter.values:
        return emitter.vector("position", (0.0, 0.0, 0.0))
    return emitter.to_world()[:3, 3]


def _spot(emitter: Plugin, warnings: Warnings) -> Light:
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
    return Light(
        "spot",
        intensity,
        to_world[:3, 3],
        unit_direction(to_world[:3, 2], emitter.where),
        inner,
        outer,
        name="spot",
    )


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
