"""Draw docs/occluded_corner.png: a room that gets no direct light, with and without visibility maps.

Run `python scripts/make_readme_image.py`. The camera looks through a doorway of the gallery into the room
behind it, whose only light is one bounce. The image shows the path tracer, VPLs without visibility, the same
tuned, and VPLs with visibility maps.
"""

from pathlib import Path

import numpy as np

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.image_file import write_png
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View
from vpltune.tuner.evaluation.comparison_image import captioned, image_row
from vpltune.tuner.evaluation.prepare_scene import SceneOptions, Stopwatch, prepare_scene
from vpltune.tuner.fitting.fit_placement import fit_placement
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.reference import reference_views
from vpltune.tuner.surrogate.captured_view import capture_views, runtime_irradiance

REPOSITORY = Path(__file__).resolve().parents[1]
SCENE = REPOSITORY / "configs" / "scenes" / "gallery.glb"
IMAGE = REPOSITORY / "docs" / "occluded_corner.png"
SIZE = (360, 270)
"""Width and height of each image in pixels. A choice."""
SAMPLES = 512
"""Most samples per pixel in each half of the reference. A choice."""
EYE, TARGET, YFOV = np.array([1.2, 1.5, 3.9]), np.array([3.9, 1.1, 1.3]), 1.0
"""The camera: where it stands and what it looks at, in world units, and its vertical field of view in
radians. A choice: none of the fitted views has this camera."""


def main() -> None:
    """Fit the gallery without visibility maps, draw the view, and write the row of images."""
    scene = read_scene(SCENE)
    view = View("round the corner", "held_out", SIZE, Camera(look_at(EYE, TARGET), YFOV), scene.lights)
    references = reference_views(scene, (view,), max_samples=SAMPLES, bounces=1)
    untuned = TunedConfig(visibility="transmittance", light=ONE_BOUNCE)
    prepared = prepare_scene(SCENE, SceneOptions(), untuned, Stopwatch(), lambda *_: None)
    fitted = tuple(each for each in prepared.views if each.view.split == "fitted")
    tuned = fit_placement(fitted, untuned.parameters, robust_errors(fitted)).parameters
    configs = {
        "transmittance, untuned": untuned,
        "transmittance, tuned": untuned.with_parameters(tuned),
        "maps, untuned": TunedConfig(visibility="maps", light=ONE_BOUNCE),
    }
    runtime = prepared.runtime
    (seen,) = capture_views(runtime, untuned, (view,), references)
    images = {}
    for name, config in configs.items():
        image = runtime_irradiance(runtime, config, seen)
        images[captioned(name, seen.metrics(image))] = image
    write_png(IMAGE, image_row(runtime, seen, images, SIZE[1]))


if __name__ == "__main__":
    main()
