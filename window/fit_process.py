"""The process that runs one fit for the window, as `vpltune fit` would, and ends with it."""

import os
import time
from dataclasses import replace
from multiprocessing.connection import Connection

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.scene.placement import views_for_scene
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View
from vpltune.tuner.evaluation.prepare_scene import LEAST_VALIDATION, VIEW_SIZE
from vpltune.tuner.scene_fit.fit_scene import FitOptions, fit_scene
from vpltune.window.drawing_process import lower_priority
from vpltune.window.requests import Failed, FitEnd, FitRequest, FitStep

VIEWS = 4
"""Fitted views where none were kept. A choice, as of `vpltune fit`."""
NICENESS = 5
"""How far the fit steps back for the process that draws. A choice."""
SECONDS_BETWEEN_STEPS = 0.1
"""Shortest time between two reports of progress. A choice: no one reads faster."""


def fit_for_window(connection: Connection, request: FitRequest) -> None:
    """Run the fit, telling how far it is; the last message is `FitEnd`, or `Failed`.

    What `vpltune fit` writes goes to the request's folder.
    """
    lower_priority(NICENESS)
    parent = os.getppid()
    told = 0.0

    def progress(stage: str, share: float) -> None:
        nonlocal told
        if os.getppid() != parent:
            raise SystemExit  # the window has gone
        now = time.monotonic()
        if now - told >= SECONDS_BETWEEN_STEPS or share in (0.0, 1.0):
            told = now
            connection.send(FitStep(stage, share))

    def traced(parameters: ArtistParameters, loss: float) -> None:
        connection.send(FitStep("fit", 0.0, loss, parameters.as_dict()))

    try:
        scene = request.source.read()
        options = FitOptions(
            start=request.start,
            fixed_views=_views(scene, request),
            command="vpltune view",
            traced=traced,
        )
        result = fit_scene(request.source.path or scene, request.output, options, progress)
    except (InputError, MachineError) as error:
        connection.send(Failed(request, str(error)))
        return
    intervals = {
        name: (interval["low"], interval["high"]) for name, interval in result.document["uncertainty"].items()
    }
    connection.send(
        FitEnd(result.config, result.status, result.document["sentence"], intervals, result.notes)
    )


def _views(scene: Scene, request: FitRequest) -> tuple[View, ...]:
    """The view of the page and the kept ones, and others around them for what they lack.

    With no kept view, the fit has as many as the command line's, moved as it moves them.
    """
    kept = [each for each in request.kept if each.camera is not request.camera]
    placed = views_for_scene(
        scene,
        request.camera,
        request.lights,
        fitted=1 if kept else VIEWS,
        validation=max(LEAST_VALIDATION, VIEWS),
        held_out=max(1, VIEWS // 2),
        size=VIEW_SIZE,
        seed=0,
    )
    own = [
        View(f"kept_{index}", "fitted", VIEW_SIZE, each.camera, request.lights)
        for index, each in enumerate(kept)
    ]
    first, *others = placed
    return (replace(first, name="fitted_0"), *own, *others)
