"""Splits the error of the tuned image by cause: replaces one term at a time, and measures again.

Each share is the relMSE that disappears with its cause, a mean over the fitted views:

- `noise`: the noise of the reference, which is part of every relMSE.
- `finite_n`: noise of the VPL placement. Let R rotations of the point table give the mean error E₁ of single
  images and the error E_R of their mean image. The variance of a mean falls as 1/R, so infinitely many
  rotations would leave E∞ = E_R − (E₁ − E_R)/(R − 1). The share is E₁ − E∞.
- `clamping`: E∞ minus the error with eight times the VPLs (at most 4,096 clustered disc lights). Their
  footprints, and with them the reach of α, are √8 times smaller. α = 0 would instead measure the bright dots
  that α prevents.
- `visibility`: error of the tuned image minus that of the ceiling, the same VPLs with ray-traced visibility.
- `filter`: error of the runtime's image minus that of a plain gather of the same VPLs.
- `remainder`: the rest. It is negative if causes overlap, and a share is negative if its cause hides another.
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
from vpltune.tuner.evaluation.prepare_scene import PreparedScene
from vpltune.tuner.metrics.view_metrics import relmse
from vpltune.tuner.surrogate.captured_view import CapturedView, runtime_irradiance
from vpltune.tuner.surrogate.virtual_point_lights import gather_inputs
from vpltune.tuner.surrogate.vpl_visibility import map_visibility

ROTATIONS = 4
"""R, the rotations of the point table. A choice."""
MORE_VPLS = 8
"""Factor of the VPL count for `clamping`. A choice."""
_MOST_VPLS = next(spec.high for spec in ARTIST_PARAMETERS if spec.name == "vpl_count")


def error_breakdown(
    prepared: PreparedScene,
    evaluation: Evaluation,
    progress: Callable[[float], None] | None = None,
) -> dict[str, float | str]:
    """Split the tuned error by cause; the module's docstring defines the shares.

    Args:
        prepared: the scene, its runtime and its views.
        evaluation: of `prepared`.
        progress: called with the share done, in [0, 1].

    Returns:
        relMSE by cause, means over the fitted views that indirect light reaches, and the key `views` with the
        value "fitted". There are no causes if all these views are unlit.

    Raises:
        MachineError: the GPU ran out of memory or reported an error.
    """
    views = [each for each in evaluation.views if each.view.view.split == "fitted" and each.view.lit]
    shares: list[dict[str, float]] = []
    for index, view in enumerate(views):
        shares.append(_of_view(prepared.runtime, view))
        if progress is not None:
            progress((index + 1) / len(views))
    causes = shares[0] if shares else {}
    return {"views": "fitted"} | {cause: fmean(share[cause] for share in shares) for cause in causes}


def _of_view(runtime: Runtime, evaluated: EvaluatedView) -> dict[str, float]:
    view, tuned = evaluated.view, evaluated.tuned
    total = evaluated.metrics["tuned"].relmse
    single, endless = _errors_of_rotations(runtime, view, tuned)
    # More VPLs than can be clustered would be drawn as points, which is another model.
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
    return shares | {"remainder": total - sum(shares.values())}


def _errors_of_rotations(runtime: Runtime, view: CapturedView, config: TunedConfig) -> tuple[float, float]:
    """E₁ and E∞ of the module's docstring."""
    # R2 steps spread the rotations evenly over the torus, so that their errors are independent.
    shifts = (np.arange(ROTATIONS)[:, None] * np.array([0.7548776662, 0.5698402910])) % 1.0
    images = [
        runtime.capture(
            view.view, config, table_rotation=(float(u), float(v)), maps=False
        ).indirect_irradiance
        for u, v in shifts
    ]
    single = fmean(_error(view, image) for image in images)
    mean = _error(view, np.asarray(np.mean(images, axis=0, dtype=np.float64)))
    return single, mean - (single - mean) / (ROTATIONS - 1)


def _plain_gather(view: CapturedView, parameters: ArtistParameters) -> np.ndarray:
    receivers, vpls = gather_inputs(view.captured)
    seen = map_visibility(view.captured, receivers, vpls, parameters)
    return surrogate_irradiance(view, parameters, seen)


def _error(view: CapturedView, image: np.ndarray) -> float:
    return relmse(image[view.valid], view.reference.irradiance[view.valid])
