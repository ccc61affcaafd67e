"""Draw docs/occluded_corner.png: what lies round the corner, with and without maps, beside the path tracer.

    python scripts/make_readme_image.py

The gallery's room behind the doorway gets no direct light: what is seen there is one bounce.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from vpltune.renderer.config.tuned_config import TunedConfig, Visibility
from vpltune.renderer.files.image_file import write_png
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.scene import Camera, look_at
from vpltune.renderer.scene.views import View
from vpltune.tuner.evaluation.comparison_image import captioned, image_row
from vpltune.tuner.evaluation.evaluate import evaluate
from vpltune.tuner.evaluation.prepare_scene import SceneOptions, Stopwatch, prepare_scene
from vpltune.tuner.fitting.fit_placement import fit_placement
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.reference import reference_views
from vpltune.tuner.surrogate.captured_view import capture_views

REPOSITORY = Path(__file__).resolve().parents[1]
SCENE = REPOSITORY / "configs" / "scenes" / "gallery.glb"
IMAGE = REPOSITORY / "docs" / "occluded_corner.png"
SIZE = (360, 270)
EYE, TARGET, YFOV = np.array([1.2, 1.5, 3.9]), np.array([3.9, 1.1, 1.3]), 1.0


def main() -> None:
    scene = read_scene(SCENE)
    # Neither camera nor image size is one that was fitted.
    view = View("round the corner", "held_out", SIZE, Camera(look_at(EYE, TARGET), YFOV), scene.lights)
    references = reference_views(scene, (view,), max_samples=512)
    images = {}
    shown: dict[Visibility, tuple[str, ...]] = {"transmittance": ("default", "tuned"), "maps": ("default",)}
    for visibility, variants in shown.items():
        config = TunedConfig(visibility=visibility)
        prepared = prepare_scene(SCENE, SceneOptions(), config, Stopwatch(), lambda *_: None)
        fitted = tuple(each for each in prepared.views if each.view.split == "fitted")
        parameters = fit_placement(fitted, config.parameters, robust_errors(fitted)).parameters
        tuned = replace(config, parameters=parameters)
        (seen,) = capture_views(prepared.runtime, config, (view,), references)
        (evaluated,) = evaluate(scene, prepared.runtime, (seen,), config, tuned).views
        for variant in variants:
            name = {"default": "untuned", "tuned": "tuned"}[variant]
            caption = captioned(f"{visibility}, {name}", evaluated.metrics[variant])
            images[caption] = evaluated.irradiance[variant]
        row = image_row(prepared.runtime, seen, images, SIZE[1])
    write_png(IMAGE, row)


if __name__ == "__main__":
    main()
