"""How much of the error the worst pixels hold: by relMSE, by the former loss of fits, and by the present one.

Five scenes are drawn with the default config, in four views with a light position each. The former loss was
relMSE plus ten times the squared error over mean(r)². The present one is `tuner.metrics.robust_error`.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float64

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import present_scenes
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.tuner.evaluation.prepare_scene import SceneOptions, Stopwatch, prepare_scene
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.metrics.view_metrics import squared_errors
from vpltune.tuner.surrogate.captured_view import CapturedView

SCENES = ("cornell-box", "gallery", "godot-living-room", "kajiya-cornell-box", "playcanvas-house")
"""Scenes of different kinds: rooms, a Cornell box, a house. A choice."""
VIEWS = 4
"""Views of each scene: as many as a fit has by default."""
PLAIN_WEIGHT = 10.0
"""Weight of the plain squared error in the former loss."""
SHARES = {"0.1": 0.001, "1": 0.01}
"""Shares of a view's pixels by their per cent, as row names have them. A choice."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each scene, measure and share of pixels, the part of the error that the worst pixels hold.

    It is compared with their part of the former loss.
    """
    made, present = [], present_scenes()
    scenes = [name for name in SCENES if name in present]
    for index, name in enumerate(scenes):
        progress(f"error_location: {name}", index / len(scenes))
        options = SceneOptions(views=VIEWS, held_out=0)
        prepared = prepare_scene(
            present[name], options, TunedConfig(light=ONE_BOUNCE), Stopwatch(), lambda *_: None
        )
        views = [pixel_errors(view) for view in prepared.views if view.lit]
        for percent, share in SHARES.items():
            held = {
                measure: float(np.mean([worst_share(view[measure], share) for view in views]))
                for measure in views[0]
            }
            made += [
                Row(
                    f"{name}.{measure}.worst_{percent}_percent",
                    held[measure],
                    "1",
                    "the former loss",
                    held["former"],
                )
                for measure in ("relmse", "robust")
            ]
    progress("error_location", 1.0)
    return made


def pixel_errors(view: CapturedView) -> dict[str, Float64[np.ndarray, " pixels"]]:
    """What each pixel of the captured image adds to relMSE, to the former loss and to the robust error."""
    (counted,) = robust_errors([view])
    chosen = np.flatnonzero(view.captured.valid.ravel())[view.fitted_pixels(view.valid.size, 0)]
    image, reference = (
        image.reshape(-1, 3)[chosen].astype(np.float64)
        for image in (view.captured.indirect_irradiance, view.reference.irradiance)
    )
    relative = squared_errors(image, reference)
    plain = ((image - reference) ** 2).mean(axis=1) / reference.mean() ** 2
    return {"relmse": relative, "former": relative + PLAIN_WEIGHT * plain, "robust": counted.costs(image)}


def worst_share(errors: Float64[np.ndarray, " pixels"], share: float) -> float:
    """The part of the sum of `errors` that its largest terms hold, a `share` of all terms."""
    count = int(np.ceil(share * len(errors)))
    total = errors.sum()
    return float(np.sort(errors)[-count:].sum() / total) if total > 0.0 else 0.0
