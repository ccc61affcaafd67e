"""Mitsuba's environment emitters: `constant` and `envmap`."""

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.environment import Environment, even_sky
from vpltune.renderer.scene.environment_baking import baked_environment
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.environment_file import environment_planes, is_environment_file
from vpltune.renderer.scene.files.limits import LARGEST_RADIOMETRIC
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin

ENVIRONMENTS = ("constant", "envmap")
"""The types of emitters that are read here."""
# A choice: how far a transform may be from a rotation of one scale before that is said, relative.
_TOLERANCE = 1e-4


def environment_of(emitter: Plugin, folder: SceneFolder, warnings: Warnings) -> Environment | None:
    """The environment of an emitter; None if it is black or cannot be read, which is said.

    Args:
        emitter: a plugin of a type in `ENVIRONMENTS`.
        folder: the folder from which the image is read.
        warnings: takes a line for each approximation.

    Raises:
        SceneFileError: the image is too large or broken, or a value is invalid.
    """
    if emitter.type == "constant":
        radiance = emitter.vector("radiance", (1.0, 1.0, 1.0)) * emitter.number("scale", 1.0)
        if not ((radiance >= 0.0).all() and radiance.max() <= LARGEST_RADIOMETRIC):
            most = f"{LARGEST_RADIOMETRIC:g}"
            raise SceneFileError(
                f"{emitter.where}: radiance must be from 0 to {most}, got {radiance.tolist()}"
            )
        red, green, blue = radiance.tolist()
        return even_sky((red, green, blue)) if radiance.any() else None
    name = emitter.text("filename")
    try:
        content = folder.read(name, emitter.where)
    except SceneFileError as error:
        warnings.add(f"the environment {name!r:.80} is ignored: {error}")
        return None
    if not is_environment_file(name):
        warnings.add(f"the environment {name!r:.80} is ignored: only .exr and .hdr images are supported")
        return None
    planes = environment_planes(content, name, emitter.number("scale", 1.0), f"{emitter.where}: {name!r:.80}")
    if not any(plane.any() for plane in planes):
        return None
    return baked_environment(planes, turn_of(emitter, warnings))


def turn_of(emitter: Plugin, warnings: Warnings) -> Float64[np.ndarray, "3 3"]:
    """The rotation of `to_world`, mirrored if that is: the nearest to the matrix (Higham 1986).

    Args:
        emitter: a plugin that is an environment.
        warnings: takes a line if the matrix stretches, too.
    """
    matrix = emitter.to_world()[:3, :3]
    left, stretch, right = np.linalg.svd(matrix)
    if stretch[0] - stretch[2] > _TOLERANCE * stretch[0]:
        warnings.add("the environment is turned as its to_world says, but not stretched")
    return left @ right
