"""Mitsuba's environment maps: the brightest part of an OpenEXR image becomes one directional light."""

import math
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR
from jaxtyping import Float32, Float64

from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.image_texels import ImageDecoder
from vpltune.renderer.scene.files.limits import DecodedBytes
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin
from vpltune.renderer.scene.mitsuba_import.values import unit_direction
from vpltune.renderer.scene.scene import Light

# A choice: half angle of the part of an environment that becomes one directional light, radians.
_SUN_CONE = math.radians(30.0)
# A choice: rows of the coarse map in which the brightest part of an environment is searched; 7.5° each.
_COARSE_ROWS = 24
# Bytes of a pixel in each channel: half, single precision and unsigned integers take at most four.
_BYTES_PER_VALUE = 4


def environment_light(
    emitter: Plugin, folder: SceneFolder, across: float, warnings: Warnings
) -> tuple[Light, float] | None:
    """A directional light with the light vector of the brightest part of the environment.

    The light vector (Gershun 1939) is the net irradiance through a surface perpendicular to it. That of the
    whole environment would point between a low sun and the zenith, where rooms have ceilings.

    Args:
        emitter: the plugin.
        folder: the folder from which the image is read.
        across: area of a disc as wide as the scene, for the flux.
        warnings: takes a line for each approximation.

    Returns:
        The light and its flux in W; None if no punctual light can represent it.

    Raises:
        SceneFileError: the image is too large or broken, or a value is invalid.
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
    directions, flux = _coarse_sky(exr_channels(content, f"{emitter.where}: {name!r:.80}"))
    flux *= emitter.number("scale", 1.0)
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
    direction = unit_direction(-(emitter.to_world()[:3, :3] @ unit), emitter.where)
    warnings.add(
        f"the environment {name!r:.80} becomes one directional light, which represents its brightest "
        f"{math.degrees(2 * _SUN_CONE):.0f}° and {share:.0%} of its light"
    )
    light = Light("directional", irradiance, direction_world=direction, name="environment")
    return light, across * float(irradiance.mean())


def _coarse_sky(
    pixels: list[np.ndarray],
) -> tuple[Float64[np.ndarray, "cells 3"], Float64[np.ndarray, "cells 3"]]:
    """Unit directions of the cells of a coarse map, and the integral of radiance over each cell."""
    rows, columns = pixels[0].shape
    first_row, first_column = _cell_starts(rows, _COARSE_ROWS), _cell_starts(columns, 2 * _COARSE_ROWS)
    azimuth = 2.0 * np.pi * (np.arange(columns) + 0.5) / columns
    polar = np.pi * (np.arange(rows) + 0.5) / rows
    solid_angle = 2.0 * np.pi / columns * np.pi / rows * np.sin(polar)
    # Weighted sums over the rows of a cell as a product of matrices, since there may be 67 million pixels.
    cell = np.repeat(np.arange(len(first_row)), np.diff([*first_row, rows]))
    weights = np.where(cell == np.arange(len(first_row))[:, None], solid_angle, 0.0).astype(np.float32)
    by_column = np.stack([weights @ channel for channel in pixels], axis=-1)
    flux = np.add.reduceat(by_column, first_column, axis=1, dtype=np.float64)
    sine, cosine = np.add.reduceat(np.sin(polar), first_row), np.add.reduceat(np.cos(polar), first_row)
    # Mitsuba measures azimuth from −Z towards +X, and the polar angle from +Y.
    across = np.add.reduceat(np.sin(azimuth), first_column), np.add.reduceat(np.cos(azimuth), first_column)
    widths = np.diff([*first_column, columns])
    middle = np.stack(
        [np.outer(sine, across[0]), np.outer(cosine, widths), -np.outer(sine, across[1])], axis=-1
    ).reshape(-1, 3)
    length = np.linalg.norm(middle, axis=1)
    used = length > 0.0
    return middle[used] / length[used, None], flux.reshape(-1, 3)[used]


def _cell_starts(count: int, cells: int) -> np.ndarray:
    """The first of the rows or columns of each cell, of which there are no more than these."""
    cells = min(count, cells)
    return -(-np.arange(cells) * count // cells)


def exr_channels(content: bytes, where: str) -> list[np.ndarray]:
    """Red, green and blue of an OpenEXR image, each [height, width], in single precision.

    Args:
        content: the file.
        where: the place in the scene's file, for messages.

    Raises:
        SceneFileError: the image is too large, is broken or lacks a channel, or a value is negative or not
            finite.
    """
    # OpenEXR 3.3 can only read from a file.
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "environment.exr"
        copy.write_bytes(content)
        try:
            _check_header(OpenEXR.File(str(copy), header_only=True), len(content), where)
            # As one array, the channels would take twice the memory.
            channels = OpenEXR.File(str(copy), separate_channels=True, num_threads=0).channels()
        except SceneFileError:
            raise
        except Exception as error:  # OpenEXR raises many types, none of its own
            raise SceneFileError(f"{where}: is not an OpenEXR image ({error})") from error
    if not all(name in channels for name in "RGB"):
        raise SceneFileError(f"{where}: must have channels R, G and B, got {', '.join(sorted(channels))}")
    pixels = [_single(channels[name].pixels) for name in "RGB"]
    # The least and the largest are no numbers if any pixel is none.
    if not all(channel.min() >= 0.0 and channel.max() < math.inf for channel in pixels):
        raise SceneFileError(f"{where}: radiance must be finite and ≥ 0")
    return pixels


def _single(values: np.ndarray) -> Float32[np.ndarray, "height width"]:
    """The values in single precision. Half precision goes by a table, five times as fast as numpy."""
    if values.dtype != np.float16:
        return values.astype(np.float32, copy=False)
    table = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)
    return table[values.view(np.uint16)]


def _check_header(header_only: OpenEXR.File, encoded: int, where: str) -> None:
    """Check the size of an image by its header, before anything is decoded: all parts, and all channels."""
    images, decoded = ImageDecoder(()), DecodedBytes(what="an environment map")
    for part in header_only.parts:
        low, high = part.header["dataWindow"]
        width, height = (int(high[axis]) - int(low[axis]) + 1 for axis in range(2))
        images.admit((width, height), encoded, where)
        decoded.spend(_BYTES_PER_VALUE * width * height * len(part.header["channels"]), where)
