"""The error that is left, split by cause: one term of the image swapped at a time, and measured again.

Every share is the relMSE that goes away with its cause, over the fitted views:

- `noise`: the reference's own, which no image is without.
- `finite_n`: with R rotations of the point table, errors E₁ of single images and E_R of their mean,
  infinitely many rotations would leave E = E_R − (E₁ − E_R)/(R − 1): the variance of a mean falls as 1/R.
- `clamping`: that E, less the error with eight times the VPLs (of clustered discs, at most 4,096), whose
  footprints, and with them the reach of α, are √8 times smaller. (α = 0 in their place would measure the
  bright dots that α is there to prevent.)
- `visibility`: the tuned image, less the ceiling's, which is the same VPLs with rays for visibility.
- `filter`: the runtime's image, less a plain gather's of the same VPLs.
- `missing_bounces`: against all bounces, less against one, where all bounces were asked for.
- `remainder`: what these leave. Causes act on each other, so it may be negative, as may any share whose cause
  makes up for another's.
"""

from collections.abc import Callable
from dataclasses import replace
from statistics import fmean

import numpy as np

from vpltune.renderer.config.artist_parameters import (
    ARTIST_PARAMETERS,
    LARGEST_DISC_COUNT,
    ArtistParameters,
)
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.evaluation.evaluate import EvaluatedView, Evaluation, surrogate_irradiance
from vpltune.tuner.evaluation.prepare_scene import PreparedScene, SceneOptions, references_of
from vpltune.tuner.metrics.view_metrics import relmse
from vpltune.tuner.reference.reference_view import ReferenceView
from vpltune.tuner.surrogate.captured_view import CapturedView, runtime_irradiance
from vpltune.tuner.surrogate.virtual_point_lights import gather_inputs
from vpltune.tuner.surrogate.vpl_visibility import map_visibility

ROTATIONS = 4
MORE_VPLS = 8
_MOST_VPLS = next(spec.high for spec in ARTIST_PARAMETERS if spec.name == "vpl_count")


def error_breakdown(
    prepared: PreparedScene,
    evaluation: Evaluation,
    options: SceneOptions,
    progress: Callable[[float], None] | None = None,
) -> dict[str, float | str]:
    """relMSE by cause, means over the fitted views that light reaches, and `views`, which says so.

    Args:
        options: what `prepared` was made with.
        progress: called with the share done, in [0, 1].
    """
    views = [each for each in evaluation.views if each.view.view.split == "fitted" and each.view.lit]
    less: tuple[ReferenceView | None, ...] = (None,) * len(views)
    if options.bounces == "all":
        less = references_of(prepared.scene, tuple(view.view.view for view in views), options.seed, "1")
    shares: list[dict[str, float]] = []
    for index, (view, one_bounce) in enumerate(zip(views, less, strict=True)):
        shares.append(_of_view(prepared.runtime, view, one_bounce))
        if progress is not None:
            progress((index + 1) / len(views))
    causes = shares[0] if shares else {}
    return {"views": "fitted"} | {cause: fmean(share[cause] for share in shares) for cause in causes}


def _of_view(
    runtime: Runtime, evaluated: EvaluatedView, one_bounce: ReferenceView | None
) -> dict[str, float]:
    view, tuned = evaluated.view, evaluated.tuned
    total = evaluated.metrics["tuned"].relmse
    single, endless = _errors_of_rotations(runtime, view, tuned)
    # More clustered discs than that are drawn as points: another model, and no measure of clamping.
    parameters = tuned.parameters
    most = LARGEST_DISC_COUNT if parameters.lloyd_iterations > 0 else _MOST_VPLS
    count = min(MORE_VPLS * parameters.vpl_count, max(most, parameters.vpl_count))
    many = tuned.with_parameters(replace(parameters, vpl_count=int(count)))
    shares = {
        "noise": evaluated.noise_floor,
        "finite_n": single - endless,
        "clamping": endless - _error(view, runtime_irradiance(runtime, many, view)),
        "visibility": total - evaluated.metrics["ceiling"].relmse,
        "filter": total - _error(view, _plain_gather(view, parameters)),
    }
    if one_bounce is not None:
        valid = view.valid & one_bounce.valid
        image, less = evaluated.irradiance["tuned"][valid], one_bounce.irradiance[valid]
        shares["missing_bounces"] = relmse(image, view.reference.irradiance[valid]) - relmse(image, less)
    return shares | {"remainder": total - sum(shares.values())}


def _errors_of_rotations(runtime: Runtime, view: CapturedView, config: TunedConfig) -> tuple[float, float]:
    """relMSE of one image, on average, and of infinitely many of them."""
    # Evenly over the torus: rotations of a table that lie apart err independently of each other.
    shifts = (np.arange(ROTATIONS)[:, None] * np.array([0.7548776662, 0.5698402910])) % 1.0
    images = [
        runtime.capture(
            view.view, config, table_rotation=(float(u), float(v)), maps=False
        ).indirect_irradiance
        for u, v in shifts
    ]
    single = fmean(_error(view, image) for image in images)
    mean = _error(view, np.mean(images, axis=0, dtype=np.float64))
    return single, mean - (single - mean) / (ROTATIONS - 1)


def _plain_gather(view: CapturedView, parameters: ArtistParameters) -> np.ndarray:
    receivers, vpls = gather_inputs(view.captured)
    seen = map_visibility(view.captured, receivers, vpls, parameters)
    return surrogate_irradiance(view, parameters, seen)


def _error(view: CapturedView, image: np.ndarray) -> float:
    return relmse(image[view.valid], view.reference.irradiance[view.valid])
