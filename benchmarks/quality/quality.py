"""How close default, tuned and ceiling come to the path tracer: every scene, on fitted and held-out views.

Each view has a light position of its own. The images and all figures by view go to out/quality/<scene>.
"""

from collections.abc import Callable

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import REPOSITORY, present_scenes
from vpltune.tuner.evaluation.evaluate import SPLITS
from vpltune.tuner.scene_fit.fit_scene import FitOptions, fit_scene

VIEWS = 2
FIGURES = ("relmse", "energy_ratio", "flip")


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each scene, split and figure: tuned against default, and ceiling against the noise floor."""
    measured = []
    for name, path in present_scenes().items():
        output = REPOSITORY / "out" / "quality" / name
        fitted = fit_scene(
            path,
            output,
            FitOptions(views=VIEWS),
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
