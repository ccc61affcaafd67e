"""The layer `discs`: each clustered disc drawn on the surface that it stands for, in its colour."""

import math

import numpy as np
from jaxtyping import Float32, UInt8

from vpltune.renderer.files.srgb import LUMINANCE, srgb_from_linear
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.scene.views import View

BACKGROUND = 0.35
"""Brightness of the image under the discs, without its colour. A choice: contours stay visible."""
THICKNESS = 0.1
"""Distance from a disc's plane, in radii, within which a surface counts as the disc's. A choice."""
RIM = 0.9
"""Where the dark rim of a disc begins, in radii. A choice."""
BRIGHTEST = 95.0
"""Percentile of the discs' exitance that is shown as white. A choice: a few in the beam's centre may clip."""


def discs_on_surfaces(
    captured: CapturedFrame, view: View, image: UInt8[np.ndarray, "height width 3"]
) -> UInt8[np.ndarray, "height width 3"]:
    """The image in dark grey, with each VPL of the frame as a disc of its footprint on the surface around it.

    Where discs overlap, the one whose centre is nearest in radii is seen.
    """
    grey = BACKGROUND * (image.astype(np.float32) @ LUMINANCE.astype(np.float32)) / 255.0
    shown = np.repeat(grey[..., None], 3, axis=2)
    colors = _colors(captured)
    nearest = np.full(captured.valid.shape, np.inf, np.float32)
    for index in np.flatnonzero((captured.vpl_footprint > 0.0) & captured.vpl_flux.any(axis=1)):
        window = _window(captured.vpl_position_world[index], float(captured.vpl_footprint[index]), view)
        if window is None:
            continue
        offset = captured.position_world[window] - captured.vpl_position_world[index]
        radius = captured.vpl_footprint[index]
        distance = np.linalg.norm(offset, axis=-1) / radius
        off_plane = np.abs(offset @ captured.vpl_normal_world[index]) / radius
        mine = (distance <= 1.0) & (off_plane <= THICKNESS) & (distance < nearest[window])
        mine &= captured.valid[window]
        nearest[window][mine] = distance[mine]
        rim = np.where(distance[mine] > RIM, 0.5, 1.0)
        shown[window][mine] = colors[index] * rim[:, None]
    return np.round(np.clip(shown, 0.0, 1.0) * 255.0).astype(np.uint8)


def _colors(captured: CapturedFrame) -> Float32[np.ndarray, "vpls 3"]:
    """sRGB colours in [0, 1] in proportion to the exitance of each VPL."""
    area = np.pi * np.maximum(captured.vpl_footprint, 1e-30) ** 2
    exitance = captured.vpl_flux / area[:, None]
    peak = exitance.max(axis=1)
    lit = peak[peak > 0.0]
    white = float(np.percentile(lit, BRIGHTEST)) if lit.size else 1.0
    return srgb_from_linear(np.clip(exitance / white, 0.0, 1.0)).astype(np.float32)


def _window(center: Float32[np.ndarray, "3"], radius: float, view: View) -> tuple[slice, slice] | None:
    """Rows and columns that a ball around `center` can cover; None if it is behind the camera or outside."""
    width, height = view.size
    local = view.camera.world_to_camera[:3, :3] @ center + view.camera.world_to_camera[:3, 3]
    depth = -float(local[2])
    if depth + radius <= 0.0:
        return None
    # A ball that reaches the eye may cover everything.
    near = depth - radius
    if near <= 0.0:
        return slice(0, height), slice(0, width)
    focal = 0.5 * height / math.tan(view.camera.yfov / 2.0)
    reach = focal * radius / near
    # The centre's own place, and how far the nearest edge may lie from it.
    x = width / 2.0 + focal * float(local[0]) / depth
    y = height / 2.0 - focal * float(local[1]) / depth
    aside = reach * (1.0 + abs(float(local[0])) / depth), reach * (1.0 + abs(float(local[1])) / depth)
    rows = slice(max(0, math.floor(y - aside[1])), min(height, math.ceil(y + aside[1]) + 1))
    columns = slice(max(0, math.floor(x - aside[0])), min(width, math.ceil(x + aside[0]) + 1))
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return None
    return rows, columns
