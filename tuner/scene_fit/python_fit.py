"""`vpltune.fit`: a fit from Python."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vpltune.renderer.config.tuned_config import TunedConfig, read_config
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View, checked_view
from vpltune.tuner.evaluation.prepare_scene import Progress, SceneOptions
from vpltune.tuner.fitting.fit_own_loss import Loss
from vpltune.tuner.scene_fit.fit_result import FitResult
from vpltune.tuner.scene_fit.fit_scene import FitOptions, fit_scene


def fit(
    scene: str | Path | Scene,
    output: str | Path | None = None,
    *,
    views: int | Sequence[View] = SceneOptions.views,
    loss: Loss | None = None,
    config: str | Path | TunedConfig = "default",
    progress: Progress | None = None,
    **options: Any,
) -> FitResult:
    """Fit a scene from Python, as `vpltune fit` does.

    With a `loss`, k, α and κ minimise its mean over the fitted views, and no interval is known. The
    validation views judge the result by the built-in measures all the same: where these are not better, the
    start is kept, and `FitResult.fitted` has what the loss led to.

    Args:
        scene: a glTF, OBJ or PLY file, or a scene in memory.
        output: folder for tuned.json, views.json, metrics.json, images.npz and comparison.png; None writes
            nothing.
        views: number of fitted views, or views of your own. Of a split that these lack, views are placed
            around the first fitted one.
        loss: a JAX function of the indirect irradiance [W/m²] of one view, predicted and by the reference,
            each [receivers, 3], that returns one number.
        config: where the fit begins: a config, a config file, "default" or "auto".
        progress: called with the name of a stage and the share of it that is done, in [0, 1].
        options: other fields of `FitOptions`: seed, camera, light, size, held_out, budget, motion …

    Raises:
        InputError: the config, the scene, its sidecar, a view or the output folder cannot be used, or the
            loss is not one finite number.
        MachineError: there is no OpenGL 4.5, or the GPU ran out of memory.

    Example:
        >>> vpltune.fit("configs/scenes/cornell-box.glb", "out/cornell", views=4).status
        'kept'
        >>> vpltune.fit(vpltune.scene_from_arrays(positions, triangles)).config
        TunedConfig(k 1, α 1, κ 0, 512 VPLs, maps, improved)
    """
    given = views if isinstance(views, int) else tuple(views)
    if given in (0, ()) or (isinstance(given, int) and given < 1):
        raise InputError("views: must be at least one, got none")
    if isinstance(given, int):
        options["views"] = given
    else:
        options["views"] = len(given)
        options["fixed_views"] = tuple(checked_view(view, f"views[{i}]") for i, view in enumerate(given))
    start = config if isinstance(config, TunedConfig) else read_config(config)
    return fit_scene(
        scene if isinstance(scene, Scene) else Path(scene),
        None if output is None else Path(output),
        FitOptions(start=start, loss=loss, **options),
        progress or (lambda stage, share: None),
    )
