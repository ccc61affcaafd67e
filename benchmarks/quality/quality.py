"""How close default, tuned and ceiling are to the path tracer, for every scene, on fitted and held-out views.

Every view has its own light position. Images and figures of each view are written to out/quality/<scene>;
`python scripts/quality_table.py` prints them as a table.
"""

from collections.abc import Callable

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import REPOSITORY, present_scenes
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.tuner.evaluation.evaluate import SPLITS
from vpltune.tuner.scene_fit.fit_scene import FitOptions, fit_scene

VIEWS = 2
"""Fitted views of each scene. A choice: few, because the scenes are many."""
FIGURES = ("relmse", "energy_ratio", "flip")


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each scene and split, the figures of tuned and ceiling against those that bound them."""
    measured = []
    for name, path in present_scenes().items():
        output = REPOSITORY / "out" / "quality" / name
        fitted = fit_scene(
            path,
            output,
            FitOptions(start=TunedConfig(light=ONE_BOUNCE), views=VIEWS),
            lambda stage, share, name=name: progress(f"{name}: {stage}", share),
        )
        for split in SPLITS:
            measured += _rows_of(f"{name}.{split}", fitted.document["metrics"][split])
    return measured


def _rows_of(name: str, metrics: dict) -> list[Row]:
    tuned, default, ceiling = (metrics[variant] for variant in ("tuned", "default", "ceiling"))
    return [
        *(Row(f"{name}.{figure}", tuned[figure], "1", "default", default[figure]) for figure in FIGURES),
        Row(f"{name}.ceiling.relmse", ceiling["relmse"], "1", "noise floor", metrics["noise_floor"]),
        Row(f"{name}.ceiling.energy_ratio", ceiling["energy_ratio"], "1", "the reference", 1.0),
        Row(f"{name}.ceiling.flip", ceiling["flip"], "1", "default", default["flip"]),
    ]
