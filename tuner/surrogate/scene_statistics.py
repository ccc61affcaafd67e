"""Statistics of a lit scene from a captured frame, as defined in `renderer.config.scene_statistics`.

Twins: scene_statistics.comp and scene_statistics_ratios.comp in shaders/auto_parameters/.
"""

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.scene_statistics import (
    MOMENT_VPLS,
    PARTNERS,
    RECEIVERS,
    STATISTIC_NAMES,
    STRIDE,
    VPLS,
)
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.frame.point_table import R2_STEPS
from vpltune.tuner.surrogate.virtual_point_lights import gather_inputs
from vpltune.tuner.surrogate.vpl_visibility import map_visibility


def scene_statistics(captured: CapturedFrame) -> Float64[np.ndarray, " statistics"]:
    """The statistics in the order of `STATISTIC_NAMES`, each in [0, 1]."""
    count = captured.asked_vpls
    found = {"vpl_count": np.log2(count) / 16.0, "visible": 1.0}
    if captured.vpl_flux.any():
        found |= _of_receivers(captured) | _of_lit_places(captured)
    return np.array([np.clip(found.get(name, 0.0), 0.0, 1.0) for name in STATISTIC_NAMES])


def _of_receivers(captured: CapturedFrame) -> dict[str, float]:
    index, pixel = _receivers(captured)
    if not len(index):
        return {}
    receivers, vpls = gather_inputs(captured, pixel)
    seen = map_visibility(captured, receivers, vpls, ArtistParameters())
    visibility = np.ones((len(index), len(vpls.position))) if seen is None else np.asarray(seen, np.float64)

    to_vpl = np.asarray(vpls.position, np.float64)[None] - np.asarray(receivers.position, np.float64)[:, None]
    squared = np.maximum((to_vpl**2).sum(-1), 1e-30)
    cosines = np.maximum((to_vpl * np.asarray(receivers.normal)[:, None]).sum(-1), 0.0)
    cosines *= np.maximum(-(to_vpl * np.asarray(vpls.normal)[None]).sum(-1), 0.0)
    footprint = np.asarray(vpls.footprint, np.float64) ** 2
    column = np.arange(len(footprint))
    paired = (column < min(captured.asked_vpls, VPLS)) & (column % STRIDE == (index % STRIDE)[:, None])
    flux = np.asarray(vpls.flux, np.float64).mean(axis=1)
    faces = paired & (cosines > 1e-4 * squared) & (flux > 0.0)
    weight = np.where(faces, flux * cosines / squared / (squared + footprint), 0.0)
    light = weight.sum(axis=1)
    lit = light > 0.0
    if not lit.any():
        return {}

    def mean(values: np.ndarray) -> np.ndarray:
        return (weight * values).sum(axis=1)[lit] / light[lit]

    visible, distance = mean(visibility), np.sqrt(squared)
    return {
        "visible": visible.mean(),
        "visible_spread": 2.0 * visible.std(),
        "near": mean(footprint / (squared + footprint)).mean(),
        "distance": mean(distance / (distance + 1.0)).mean(),
        "facing": faces.sum() / paired.sum(),
        "evenness": light.sum() ** 2 / (lit.sum() * (light**2).sum()),
    }


def _receivers(captured: CapturedFrame) -> tuple[Int64[np.ndarray, " n"], Int64[np.ndarray, " n"]]:
    """The points of the R2 sequence that hit a surface, and the index of each among the valid pixels."""
    height, width = captured.valid.shape
    point = (0.5 + np.arange(RECEIVERS)[:, None] * np.array(R2_STEPS, np.float32)) % 1.0
    column, row = np.minimum((point * [width, height]).astype(int), [width - 1, height - 1]).T
    flat = (height - 1 - row) * width + column
    met = np.flatnonzero(captured.valid.ravel()[flat])
    place = np.cumsum(captured.valid.ravel()) - 1
    return met, place[flat[met]]


def _of_lit_places(captured: CapturedFrame) -> dict[str, float]:
    count = min(captured.asked_vpls, MOMENT_VPLS)
    flux = captured.vpl_flux[:count].astype(np.float64).mean(axis=1)
    lit = flux > 0.0
    if not lit.any():
        return {}
    position = captured.vpl_position_world[:count].astype(np.float64) / captured.scene_length
    normal = captured.vpl_normal_world[:count].astype(np.float64)
    footprint = captured.vpl_footprint[:count][lit] / captured.scene_length
    share = flux / flux.sum()
    offset = position - share @ position
    covariance = (share[:, None] * offset).T @ offset
    trace = np.trace(covariance)
    minors = (trace**2 - (covariance**2).sum()) / 2.0
    cosines, pairs = 0.0, 0
    for k in range(1, PARTNERS + 1):
        other = (np.arange(count) + k) % count
        between = position[other] - position
        squared = (between**2).sum(axis=1)
        both = lit & lit[other] & (squared > 0.0)
        product = np.maximum((normal * between).sum(1), 0.0) * np.maximum(
            -(normal[other] * between).sum(1), 0.0
        )
        cosines += (product[both] / squared[both]).sum()
        pairs += int(both.sum())
    return {
        "roundness": 27.0 * np.linalg.det(covariance) / trace**3 if trace > 0.0 else 0.0,
        "flatness": 3.0 * minors / trace**2 if trace > 0.0 else 0.0,
        "coherence": float(np.linalg.norm(share @ normal)),
        "concavity": cosines / pairs if pairs else 0.0,
        "footprint": float((footprint / (footprint + 1.0)).mean()),
    }
