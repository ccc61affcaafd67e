"""Why α is 0.5 for points: the error and the energy of different α at 1,024 of them.

The images are compared with one of 32,768 VPLs at α = 0.25, which has next to no noise and loses next to no
energy. Neither visibility nor the path tracer is involved: the benchmark measures the point approximation
alone.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import OWN_SCENES
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.views import View
from vpltune.tuner.metrics.view_metrics import energy_ratio, relmse

ALPHAS = (0.25, 0.5, 0.7, 1.0)
"""Values of α to compare. A choice."""
VPLS = 1_024
"""VPLs of the compared images. A choice."""
POINTS = ArtistParameters(vpl_count=VPLS, density_importance=0.0, lloyd_iterations=0)
CONVERGED = TunedConfig(
    replace(POINTS, vpl_count=32_768, falloff_footprint=0.25), visibility="transmittance", light=ONE_BOUNCE
)
"""The config of the image that the others are compared with."""
ROTATIONS = ((0.0, 0.0), (0.3, 0.7), (0.6, 0.1), (0.15, 0.45))
"""Rotations of the point table, over which errors are averaged. A choice."""
SIZE = (96, 72)
"""Width and height of the image in pixels. A choice."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """relMSE and energy ratio of each α against the converged image: means over scenes and rotations."""
    context = create_context()
    figures: dict[float, list[tuple[float, float]]] = {alpha: [] for alpha in ALPHAS}
    for index, path in enumerate(OWN_SCENES):
        progress("falloff_default", index / len(OWN_SCENES))
        scene = read_scene(path)
        view = View(path.stem, "fitted", SIZE, scene.cameras[0], scene.lights)
        runtime = Runtime(scene, context=context)
        converged = _irradiance(runtime, view, CONVERGED, (0.0, 0.0))
        for alpha in ALPHAS:
            config = CONVERGED.with_parameters(replace(POINTS, falloff_footprint=alpha))
            for rotation in ROTATIONS:
                image = _irradiance(runtime, view, config, rotation)
                figures[alpha].append((relmse(image, converged), energy_ratio(image, converged)))
    means = {alpha: np.mean(values, axis=0) for alpha, values in figures.items()}
    progress("falloff_default", 1.0)
    return [
        row
        for alpha in ALPHAS
        for row in (
            Row(f"alpha_{alpha}_relmse", float(means[alpha][0]), "1", "alpha 1", float(means[1.0][0])),
            Row(f"alpha_{alpha}_energy", float(means[alpha][1]), "1", "converged", 1.0),
        )
    ]


def _irradiance(
    runtime: Runtime, view: View, config: TunedConfig, rotation: tuple[float, float]
) -> np.ndarray:
    """Indirect irradiance [W/m²] of the valid pixels, [pixels, 3]."""
    captured = runtime.capture(view, config, table_rotation=rotation, maps=False)
    return captured.indirect_irradiance[captured.valid]
