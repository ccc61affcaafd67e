"""Where the camera would miss light most: docs/runtime_formulas.md, "Density importance"."""

import numpy as np

from examples.formulas.reflective_shadow_map import RsmTexels
from examples.formulas.vectors import dot, length

SPREAD = 16.0
DARK_SHARE = 0.01
LEAST_IMPORTANCE = 0.05
LEAST_COSINE = 1e-3
LEAST_COSINE_PRODUCT = 0.01
SAMPLES = 4
"""Texels looked at along the side of a cell."""


def importance_cells(texels: RsmTexels, cells: int) -> dict[str, np.ndarray]:
    """[cells, cells] of one face: flux-weighted mean position and normal, mean flux, area."""
    resolution = len(texels.area)
    at = ((np.arange(SAMPLES * cells) + 0.5) / (SAMPLES * cells) * resolution).astype(int)

    def blocks(values: np.ndarray) -> np.ndarray:
        sampled = values[np.ix_(at, at)].reshape(cells, SAMPLES, cells, SAMPLES, -1)
        return sampled.swapaxes(1, 2).reshape(cells, cells, SAMPLES**2, -1)

    flux = blocks(texels.mean_flux)
    total = flux.sum(axis=2)
    safe = np.maximum(total, 1e-300)
    position = (flux * blocks(texels.position)).sum(axis=2) / safe
    normal = (flux * blocks(texels.normal)).sum(axis=2) / safe
    straight = length(normal)
    usable = (total[..., 0] > 0.0) & (straight > 1e-4)
    of_sample = (resolution / (cells * SAMPLES)) ** 2
    return {
        "position": position,
        "normal": normal / np.maximum(straight, 1e-300)[..., None],
        "flux": np.where(usable, total[..., 0] / SAMPLES**2, 0.0),
        "area": (blocks(texels.area) * (flux > 0.0)).sum(axis=2)[..., 0] * of_sample,
    }


def cell_form(position, normal, cells: dict) -> np.ndarray:
    """[receivers, cells]: irradiance for each watt of a cell, its light spread over a disc around it."""
    to_cell = cells["position"].reshape(-1, 3)[None] - position[:, None]
    squared = np.maximum(dot(to_cell, to_cell), 1e-30)
    least = LEAST_COSINE * np.sqrt(squared)
    cosine_receiver = np.maximum(dot(normal[:, None], to_cell) - least, 0.0)
    cosine_cell = np.maximum(-dot(cells["normal"].reshape(-1, 3)[None], to_cell) - least, 0.0)
    cosines = np.maximum(cosine_receiver * cosine_cell / squared, LEAST_COSINE_PRODUCT)
    form = cosines / (np.pi * squared + SPREAD * cells["area"].reshape(-1)[None])
    return np.where(cells["flux"].reshape(-1) > 0.0, form, 0.0)


def importance_factor(position, normal, cells: dict, share_drawn: float) -> tuple[np.ndarray, np.ndarray]:
    """Irradiance estimates of the receivers [receivers], and the factor of each cell's sampling weight.

    `share_drawn` is η. Receivers are surface points that stand for the image.
    """
    form = cell_form(position, normal, cells)
    estimate = form @ cells["flux"].reshape(-1)
    dark = DARK_SHARE * (estimate**2).mean()
    weight = 1.0 / (estimate**2 / dark + 1.0) if dark > 0.0 else np.zeros(len(estimate))
    importance = np.sqrt((weight[:, None] * form**2).sum(axis=0))
    flux = cells["flux"].reshape(-1)
    missed = (flux * importance).sum()
    share = importance * flux.sum() / missed if missed > 0.0 else np.ones(len(importance))
    factor = share_drawn * share + max(1.0 - share_drawn, LEAST_IMPORTANCE)
    return estimate, factor.reshape(cells["flux"].shape)
