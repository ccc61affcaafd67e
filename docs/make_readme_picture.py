"""Draw docs/occluded_corner.png: what lies round the corner, with and without maps, beside the path tracer.

    python docs/make_readme_picture.py

The gallery's room behind the doorway gets no direct light: what is seen there is one bounce.
"""

from pathlib import Path

import numpy as np

from renderer.image_file import write_png
from renderer.scene import Camera, look_at
from renderer.scene_file import read_scene
from renderer.tuned_config import TunedConfig
from renderer.views import View
from tuner.captured_view import capture_views
from tuner.comparison_picture import captioned, picture_row
from tuner.evaluate import evaluate
from tuner.fit_placement import fit_placement
from tuner.fit_views import robust_errors
from tuner.prepare_scene import SceneOptions, Stopwatch, prepare_scene
from tuner.reference import reference_views

REPOSITORY = Path(__file__).resolve().parent.parent
SCENE = REPOSITORY / "configs" / "scenes" / "gallery.glb"
PICTURE = REPOSITORY / "docs" / "occluded_corner.png"
SIZE = (360, 270)
EYE, TARGET, YFOV = np.array([1.2, 1.5, 3.9]), np.array([3.9, 1.1, 1.3]), 1.0


def main() -> None:
    scene = read_scene(SCENE)
    # Neither camera nor picture size is one that was fitted.
    view = View("round the corner", "held_out", SIZE, Camera(look_at(EYE, TARGET), YFOV), scene.lights)
    references = reference_views(scene, (view,), max_samples=512)
    pictures = {}
    for visibility, variants in (("transmittance", ("default", "tuned")), ("maps", ("default",))):
        config = TunedConfig(visibility=visibility)
        prepared = prepare_scene(SCENE, SceneOptions(), config, Stopwatch(), lambda *_: None)
        fitted = tuple(each for each in prepared.views if each.view.split == "fitted")
        tuned = fit_placement(fitted, config.parameters, robust_errors(fitted)).parameters
        (seen,) = capture_views(prepared.runtime, (view,), references)
        (evaluated,) = evaluate(scene, prepared.runtime, (seen,), config.parameters, tuned).views
        for variant in variants:
            name = {"default": "untuned", "tuned": "tuned"}[variant]
            caption = captioned(f"{visibility}, {name}", evaluated.metrics[variant])
            pictures[caption] = evaluated.irradiance[variant]
    write_png(PICTURE, picture_row(prepared.runtime, seen, pictures, SIZE[1]))


if __name__ == "__main__":
    main()
