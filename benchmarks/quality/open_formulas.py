"""The VPL sums of two open-source RSM renderers at their shipped defaults, evaluated on our own VPLs.

Both formulas are written from the renderers' public shaders, with their default settings and absolute
lengths. VPLs, G-buffer and references are ours, so that only the formulas differ. The renderers themselves do
worse: `vpltune bench peer` compares with one of them as it draws.
"""

import numpy as np
from jaxtyping import Float, Float32

from vpltune.renderer.frame.capture import CapturedFrame

BGFX_RADIUS = 3.0
"""World units: bgfx, example 31, `m_vplRadius`."""
BGFX_AMOUNT = 0.25
"""Share of VPL light in the mix with direct light: bgfx, example 31, `m_rsmAmount`."""
BABYLON_SAMPLES = 400
"""VPLs of a pixel: Babylon.js, class GIRSM, `numSamples`."""
BABYLON_INTENSITY = 0.1
"""Factor of the indirect light: the default of Babylon.js."""
BABYLON_EDGE = 0.1
"""World units by which VPLs are pushed below their surface: class GIRSM, `edgeArtifactCorrection`."""
CHUNK = 512
"""Receivers that are summed at once. A choice: it bounds the memory."""

Irradiance = Float32[np.ndarray, "receivers 3"]


def bgfx_irradiance(captured: CapturedFrame) -> Irradiance:
    """bgfx: linear falloff 1 − d/R, no cosine at the VPL, and a sum of colours without a division by N.

    A VPL's colour stands for its radiant exitance Φ/(πl²), and white, which the sum is clamped to, for the
    largest exitance.
    """
    exitance = _exitance(captured)

    def of_pairs(to_vpl: np.ndarray, normal: np.ndarray) -> np.ndarray:
        distance = np.maximum(np.linalg.norm(to_vpl, axis=-1), 1e-12)
        facing = np.maximum(np.einsum("rvk,rk->rv", to_vpl, normal) / distance, 0.0)
        return facing * np.maximum(1.0 - distance / BGFX_RADIUS, 0.0)

    summed = _summed(captured, captured.vpl_position_world, exitance, of_pairs)
    return (BGFX_AMOUNT / (1.0 - BGFX_AMOUNT) * np.minimum(summed, exitance.max(initial=0.0))).astype(
        np.float32
    )


def babylon_irradiance(captured: CapturedFrame) -> Irradiance:
    """Babylon.js: Σ flux·ξ²·cosθ·cosθ'/d² without a division by N, times an intensity that has no unit.

    ξ is a sample's place in the sequence, in [0, 1]. The clamp to 1 is left out, since it depends on the unit
    of irradiance.
    """
    taken = np.linspace(0, len(captured.vpl_flux) - 1, min(BABYLON_SAMPLES, len(captured.vpl_flux))).astype(
        int
    )
    share = (np.arange(len(taken)) + 0.5) / len(taken)
    normal_vpl = captured.vpl_normal_world[taken].astype(np.float64)
    position = captured.vpl_position_world[taken] - BABYLON_EDGE * normal_vpl

    def of_pairs(to_vpl: np.ndarray, normal: np.ndarray) -> np.ndarray:
        squared = np.maximum((to_vpl**2).sum(axis=-1), 1e-12)
        at_receiver = np.maximum(np.einsum("rvk,rk->rv", to_vpl, normal), 0.0)
        at_vpl = np.maximum(-np.einsum("rvk,vk->rv", to_vpl, normal_vpl), 0.0)
        return at_receiver * at_vpl / squared**2

    flux = _exitance(captured)[taken] * share[:, None] ** 2
    return (BABYLON_INTENSITY * _summed(captured, position, flux, of_pairs)).astype(np.float32)


def _exitance(captured: CapturedFrame) -> Float[np.ndarray, "vpls 3"]:
    """Radiant exitance of every VPL [W/m²]."""
    area = np.maximum(np.pi * captured.vpl_footprint.astype(np.float64) ** 2, 1e-30)
    return captured.vpl_flux / area[:, None]


def _summed(captured: CapturedFrame, position: np.ndarray, light: np.ndarray, of_pairs) -> np.ndarray:
    """Σ_j light_j · of_pairs at every valid pixel, summed a chunk of receivers at a time."""
    receivers = captured.position_world[captured.valid].astype(np.float64)
    normals = captured.normal_world[captured.valid].astype(np.float64)
    sums = [
        of_pairs(position[None] - receivers[at : at + CHUNK, None], normals[at : at + CHUNK]) @ light
        for at in range(0, len(receivers), CHUNK)
    ]
    return np.concatenate(sums) if sums else np.zeros((0, 3))
