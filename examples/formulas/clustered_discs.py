"""Lloyd iterations that turn VPLs into clustered disc lights: docs/runtime_formulas.md, "Clustered discs"."""

import numpy as np

from examples.formulas.vectors import dot, length
from examples.formulas.virtual_point_lights import DARK_NORMAL, Vpls

NORMAL_REACH = 0.7
OFF_PLANE_FACTOR = 8.0
SAMPLE_REACH = 64.0
LEAST_SAMPLES = 4096
SAMPLES_OF_VPL = 4
LARGEST_COUNT = 4096


def sample_count(vpl_count: int) -> int:
    return max(LEAST_SAMPLES, SAMPLES_OF_VPL * vpl_count)


def cluster_distance(between, normal, other_normal, footprint, scene_length: float) -> np.ndarray:
    """How far a sample of this footprint is from a VPL."""
    off_plane = OFF_PLANE_FACTOR * np.maximum(abs(dot(between, normal)), abs(dot(between, other_normal)))
    unit = cluster_length(footprint, scene_length)
    return middle_distance(between, normal, other_normal, footprint, scene_length) + (off_plane / unit) ** 2


def middle_distance(between, normal, other_normal, footprint, scene_length: float) -> np.ndarray:
    """How far a sample of this footprint is from the middle of its cluster."""
    turned = 2.0 * NORMAL_REACH**2 * (1.0 - dot(normal, other_normal))
    return dot(between, between) / cluster_length(footprint, scene_length) ** 2 + turned


def cluster_length(footprint, scene_length: float) -> np.ndarray:
    return np.maximum(np.minimum(scene_length, SAMPLE_REACH * footprint), 1e-30)


def lloyd_iteration(vpls: Vpls, samples: Vpls, scene_length: float) -> Vpls:
    """Each VPL takes the light of the samples nearest to it, and moves to their middle."""
    away = cluster_distance(
        samples.position[:, None] - vpls.position[None],
        samples.normal[:, None],
        vpls.normal[None],
        samples.footprint[:, None],
        scene_length,
    )
    away = np.where(vpls.footprint > 0.0, away, np.inf)
    owner = np.where(samples.footprint > 0.0, away.argmin(axis=1), -1)
    clusters = [_cluster(samples, owner == index, scene_length) for index in range(len(vpls.footprint))]
    return Vpls(*(np.array(part) for part in zip(*clusters, strict=True)))


def _cluster(samples: Vpls, own: np.ndarray, scene_length: float):
    if not own.any():
        return np.zeros(3), DARK_NORMAL, 0.0, np.zeros(3)
    position, normal, footprint = samples.position[own], samples.normal[own], samples.footprint[own]
    # Samples count alike, whatever their flux.
    middle = position.mean(axis=0)
    facing = normal.sum(axis=0)
    facing /= max(float(length(facing)), 1e-30)
    nearest = int(middle_distance(position - middle, normal, facing, footprint, scene_length).argmin())
    # To the middle over the plane of the sample nearest to it, but within that sample's disc.
    slide = middle - position[nearest]
    slide = slide - normal[nearest] * dot(normal[nearest], slide)
    slide = slide * min(1.0, footprint[nearest] / max(float(length(slide)), 1e-30))
    # Mean squared distance of the light from the middle: between the samples, and within their own discs.
    # These overlap, and are too large, where several lights shine on one place.
    between = float(dot(position - middle, position - middle).mean())
    within = float((0.5 * footprint**2).mean())
    spread = between + (min(within, 2.0 * between / own.sum()) if own.sum() > 1 else within)
    return position[nearest] + slide, normal[nearest], np.sqrt(2.0 * spread), samples.flux[own].sum(axis=0)
