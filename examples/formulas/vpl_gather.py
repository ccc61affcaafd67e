"""Irradiance from VPLs as points and as discs: docs/runtime_formulas.md, "Gather"."""

import numpy as np

from examples.formulas.vectors import dot, length
from examples.formulas.virtual_point_lights import Vpls

LEAST_PART = 1e-4
LEAST_RADIUS = 1e-6
FADE_HEIGHT = 0.01
FACING_FADE_HEIGHT = 0.4


def point_form(position, normal, vpls: Vpls, alpha: float) -> np.ndarray:
    """[receivers, vpls]: irradiance for a flux of π watts, without transmittance."""
    to_vpl = vpls.position[None] - position[:, None]
    squared = np.maximum(dot(to_vpl, to_vpl), 1e-30)
    cosine_receiver = np.maximum(dot(normal[:, None], to_vpl), 0.0)
    cosine_vpl = np.maximum(-dot(vpls.normal[None], to_vpl), 0.0)
    return cosine_receiver * cosine_vpl / squared / (squared + (alpha * vpls.footprint) ** 2)


def disc_form(position, normal, vpls: Vpls, alpha: float, scene_length: float) -> np.ndarray:
    """[receivers, vpls]: as `point_form`, of discs of radius αℓ that are cut at the receiver's horizon."""
    to_vpl = (vpls.position[None] - position[:, None]) / scene_length
    normal, vpl_normal = normal[:, None], vpls.normal[None]
    radius = np.maximum(alpha * vpls.footprint / scene_length, LEAST_RADIUS)
    height = -dot(vpl_normal, to_vpl)
    between = dot(normal, vpl_normal)
    slope = np.sqrt(np.maximum(1.0 - between**2, 1e-12))
    above = dot(normal, to_vpl) / (slope * radius)
    share, offset = disc_past_chord(above)
    fade_height = (FADE_HEIGHT + FACING_FADE_HEIGHT * np.maximum(-between, 0.0) ** 2) * radius
    fade = np.minimum(2.0 * height / fade_height - 1.0, 1.0)
    lit = (fade > 0.0) & (share >= LEAST_PART)
    height, share = np.maximum(height, 0.0), np.maximum(share, LEAST_PART)

    # The part over the horizon shines as a disc of its area around its centroid.
    upwards = (normal - between[..., None] * vpl_normal) / slope[..., None]
    to_part = to_vpl + upwards * (offset * radius)[..., None]
    radius_squared = radius**2 * share
    squared = dot(to_part, to_part)
    q, axial = disc_axial(squared, height, radius_squared)
    lateral = height / (q + squared + radius_squared)
    vector = (to_part + height[..., None] * vpl_normal) * lateral[..., None] - vpl_normal * axial[..., None]
    # Close to the disc, it is nearly a half-space.
    uncut_q, uncut_axial = disc_axial(dot(to_vpl, to_vpl), height, radius**2)
    facing_form = 2.0 * radius**2 * uncut_axial / uncut_q
    least = np.clip(2.0 * above, 0.0, 1.0) * 0.5 * (1.0 - between) * facing_form**4 / radius**2
    received = np.maximum(dot(normal, vector) * 2.0 * share / q, least) * fade
    return np.where(lit, received, 0.0) / scene_length**2


def disc_axial(squared, height, radius_squared) -> tuple[np.ndarray, np.ndarray]:
    """Q and the axial term of the form factors to a disc of a squared radius."""
    excess = squared - radius_squared
    q = np.sqrt(np.maximum(excess**2 + 4.0 * height**2 * radius_squared, 1e-36))
    larger = q + np.abs(excess)
    return q, np.where(excess > 0.0, height**2 / larger, larger / (4.0 * radius_squared))


def disc_past_chord(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The part of a unit disc past a chord at distance t before its middle: its area share, its centroid."""
    a = np.minimum(np.abs(t), 1.0 - 1e-6)
    half_chord = np.sqrt(1.0 - a * a)
    # arccos a (Abramowitz and Stegun 1964, 4.4.45).
    angle = np.sqrt(1.0 - a) * (1.5707288 + a * (-0.2121144 + a * (0.0742610 - a * 0.0187293)))
    lesser = np.maximum(angle - a * half_chord, 0.0) / np.pi
    share = np.where(t > 0.0, 1.0 - lesser, lesser)
    return share, 2.0 / (3.0 * np.pi) * half_chord**3 / np.maximum(share, LEAST_PART)


def gather(
    position,
    normal,
    vpls: Vpls,
    scene_length: float,
    *,
    discs: bool,
    intensity=1.0,
    alpha,
    kappa,
    visibility=1.0,
) -> np.ndarray:
    """[receivers, vpls]: irradiance [W/m²] for each watt of a VPL's flux.

    Args:
        position, normal: of receivers, [receivers, 3].
        visibility: [receivers, vpls], what the maps let through; 1 without maps.
    """
    if discs:
        form = disc_form(position, normal, vpls, alpha, scene_length)
    else:
        form = point_form(position, normal, vpls, alpha)
    distance = length(vpls.position[None] - position[:, None])
    transmittance = np.exp(-kappa * distance / scene_length)
    return intensity / np.pi * form * transmittance * visibility
