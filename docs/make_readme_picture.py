"""Draw docs/occluded_corner.png: what lies round the corner, before and after, beside the path tracer.

    python docs/make_readme_picture.py

The gallery's room behind the doorway gets no direct light: what is seen there is one bounce.
"""

from pathlib import Path

import numpy as np

from renderer.scene import Camera, look_at
from renderer.scene_file import read_scene
from renderer.tuned_config import TunedConfig
from renderer.views import View
from tuner.captured_view import capture_views
from tuner.comparison_picture import write_comparison
from tuner.evaluate import evaluate
from tuner.fit_falloff import fit_falloff
from tuner.prepare_scene import SceneOptions, Stopwatch, prepare_scene
from tuner.reference import reference_views

REPOSITORY = Path(__file__).resolve().parent.parent
SCENE = REPOSITORY / "configs" / "scenes" / "gallery.glb"
PICTURE = REPOSITORY / "docs" / "occluded_corner.png"
SIZE = (360, 270)
EYE, TARGET, YFOV = np.array([1.2, 1.5, 3.9]), np.array([3.9, 1.1, 1.3]), 1.0


def main() -> None:
    scene = read_scene(SCENE)
    prepared = prepare_scene(SCENE, SceneOptions(), TunedConfig(), Stopwatch(), lambda *_: None)
    default = TunedConfig().parameters
    tuned, _ = fit_falloff(tuple(v for v in prepared.views if v.view.split == "fitted"), default)
    # Neither camera nor picture size is one that was fitted.
    view = View("round the corner", "held_out", SIZE, Camera(look_at(EYE, TARGET), YFOV), scene.lights)
    seen = capture_views(prepared.runtime, (view,), reference_views(scene, (view,), max_samples=512))
    evaluation = evaluate(prepared.scene, prepared.runtime, (*prepared.views, *seen), default, tuned)
    write_comparison(PICTURE, prepared.runtime, (evaluation.views[-1],), SIZE[1])


if __name__ == "__main__":
    main()
