"""Drawing virtual point lights (VPLs) from RSM texels: docs/runtime_formulas.md, "Drawing VPLs"."""

from dataclasses import dataclass

import numpy as np

from examples.formulas.reflective_shadow_map import MIN_COSINE, RsmTexels, texel_rays
from examples.formulas.vectors import dot, length

SAME_SURFACE_COSINE, SAME_SURFACE_SLOPE = 0.9, 0.1
DARK_NORMAL = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Vpls:
    """VPLs; a dark one has neither flux nor footprint."""

    position: np.ndarray
    normal: np.ndarray
    footprint: np.ndarray
    """ℓ, the radius of the disc that a VPL stands for [world units]."""
    flux: np.ndarray
    """[vpls, 3] reflected radiant flux [W]."""


def sampling_weights(texels: RsmTexels, exponent: float, importance: np.ndarray | float = 1.0) -> np.ndarray:
    """[row, column]: flux^γ times the importance factor; 0 where nothing is lit."""
    flux = texels.mean_flux
    lit = flux > 0.0
    return np.where(lit, np.where(lit, flux, 1.0) ** exponent * importance, 0.0)


def draw_vpls(
    texels: RsmTexels, face: dict, weights: np.ndarray, points: np.ndarray, filtering: int = 5
) -> Vpls:
    """One VPL for each point of the table, from an atlas of one face.

    An atlas of several faces is drawn alike: rows run through all tiles, and a window stays in its tile.
    """
    in_row = np.cumsum(weights, axis=1)
    of_rows = np.cumsum(in_row[:, -1])
    if not of_rows[-1] > 0.0:
        count = len(points)
        return Vpls(
            np.zeros((count, 3)), np.tile(DARK_NORMAL, (count, 1)), np.zeros(count), np.zeros((count, 3))
        )
    vpls = [_draw(texels, face, weights, in_row, of_rows, point, len(points), filtering) for point in points]
    return Vpls(*(np.array(part) for part in zip(*vpls, strict=True)))


def _draw(texels, face, weights, in_row, of_rows, point, count, filtering):
    total = of_rows[-1]
    # First index whose running sum exceeds the target.
    y = point[1] * total
    row = int(np.searchsorted(of_rows, y, side="right"))
    x = point[0] * in_row[row, -1]
    column = int(np.searchsorted(in_row[row], x, side="right"))
    # What the inversion leaves over is the place in the texel, in [0, 1)².
    before = np.array([in_row[row, column - 1] if column else 0.0, of_rows[row - 1] if row else 0.0])
    upto = np.array([in_row[row, column], of_rows[row]])
    within = np.clip((np.array([x, y]) - before) / (upto - before), 0.0, 1.0)

    reach, size = filtering // 2, face["resolution"]
    window = np.s_[
        max(row - reach, 0) : min(row + reach + 1, size), max(column - reach, 0) : column + reach + 1
    ]
    lit = texels.mean_flux[window] > 0.0
    # N · p: how many VPLs are expected in the window.
    draws = count * weights[window][lit].sum() / total
    area = texels.area[window][lit].sum() / draws
    flux = texels.flux[window][lit].sum(axis=0) / draws
    position, normal = texels.position[row, column], texels.normal[row, column]
    if filtering > 1:
        towards = np.where(within < 0.5, -1, 1)
        slides = (
            _goes_on(texels, row, column, row, column + towards[0]),
            _goes_on(texels, row, column, row + towards[1], column),
        )
        within = np.where(slides, within, 0.5)
        position = _on_plane(face, position, normal, np.array([column, row]) + within)
    return position, normal, np.sqrt(area / np.pi), flux


def _goes_on(texels: RsmTexels, row: int, column: int, other_row: int, other_column: int) -> bool:
    """Whether a texel's surface goes on into the one beside it."""
    rows, columns = texels.mean_flux.shape
    if not (0 <= other_row < rows and 0 <= other_column < columns):
        return False
    normal, other = texels.normal[row, column], (other_row, other_column)
    between = texels.position[other] - texels.position[row, column]
    return bool(
        texels.mean_flux[other] > 0.0
        and dot(texels.normal[other], normal) > SAME_SURFACE_COSINE
        and abs(dot(between, normal)) < SAME_SURFACE_SLOPE * length(between)
    )


def _on_plane(face: dict, position: np.ndarray, normal: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Where the light's ray through a place of the face meets the texel's plane."""
    origin, ray = texel_rays(face, place)
    along = dot(normal, ray)
    if along > -MIN_COSINE * length(ray):
        return position
    return origin + ray * (dot(normal, position - origin) / along)
