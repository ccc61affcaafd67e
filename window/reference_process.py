"""The process that path-traces what someone looks at: coarse at first, then finer, until it is good."""

from collections.abc import Iterator
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

from vpltune.renderer.scene.animation import AnimationPlayer
from vpltune.renderer.scene.scene import Instance, Scene
from vpltune.tuner.reference import reference_views
from vpltune.tuner.reference.reference_view import noise_floor
from vpltune.window.drawing_process import lower_priority, posed_lights, serve
from vpltune.window.reference_file import ReferenceImages, write_reference
from vpltune.window.requests import ReferenceRequest, ReferenceStep, SceneSource

STAGES = ((4, 16), (2, 16), (1, 16), (1, 64), (1, 256), (1, 1024))
"""Divisor of the image's sides, and samples of each pixel and half. A choice: the first is there at once, and
all together take a third more than the last alone."""
NOISE_TARGET = 1e-3
"""relMSE of the noise at which a reference is done. A choice: below what is seen at this size."""
NICENESS = 10
"""How far the process steps back for the one that draws. A choice."""


class _SupersededError(Exception):
    """Somebody looks elsewhere by now."""


def trace_for_window(connection: Connection, source: SceneSource, folder: Path) -> None:
    """Serve `ReferenceRequest`s; a new one ends the one before. Files go to `folder`."""
    lower_priority(NICENESS)
    scene = source.read()
    number = 0

    def answer(request: ReferenceRequest) -> None:
        nonlocal number
        try:
            for step, images in _steps(scene, request, connection):
                if images is not None:
                    number += 1
                    path = folder / f"reference-{number}.npz"
                    write_reference(path, images)
                    step = replace(step, path=path)
                connection.send(step)
        except _SupersededError:
            pass

    serve(connection, answer)


def _steps(
    scene: Scene, request: ReferenceRequest, connection: Connection
) -> Iterator[tuple[ReferenceStep, ReferenceImages | None]]:
    posed, view = _posed(scene, request)
    width, height = view.size
    work = [samples / divisor**2 for divisor, samples in STAGES]
    done = 0.0
    for (divisor, samples), amount in zip(STAGES, work, strict=True):
        size = (max(1, width // divisor), max(1, height // divisor))

        def heed(_view: str, _share: float) -> None:
            if connection.poll():
                raise _SupersededError

        (reference,) = reference_views(
            posed,
            (replace(view, size=size),),
            noise_target=NOISE_TARGET if divisor == 1 else 0.0,
            max_samples=samples,
            bounces=request.bounces,
            progress=heed,
        )
        done += amount
        noise = noise_floor(reference)
        finished = divisor == 1 and (noise <= NOISE_TARGET or samples == STAGES[-1][1])
        share = 1.0 if finished else done / sum(work)
        images = ReferenceImages(
            reference.irradiance,
            reference.direct_irradiance,
            reference.albedo,
            reference.position_world,
            reference.valid,
        )
        yield ReferenceStep(request, share, noise, None), images
        if finished:
            return


def _posed(scene: Scene, request: ReferenceRequest):
    """The scene and the view as they are at the request's time. Skinned meshes keep their rest pose."""
    if request.seconds is None or scene.animation is None:
        return scene, request.view
    pose = AnimationPlayer(scene).pose_at(request.seconds)
    instances = tuple(
        Instance(each.name, each.mesh, matrix)
        for each, matrix in zip(scene.instances, pose.transforms, strict=True)
    )
    lights = posed_lights(request.view.lights, request.follows, pose)
    return replace(scene, instances=instances), replace(request.view, lights=lights)
