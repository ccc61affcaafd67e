"""The process that owns the runtime: it draws one request at a time, and nothing else waits for it."""

import io
import os
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.animation import AnimationPlayer, Pose
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.placement.scene_sidecar import completed_camera_and_lights
from vpltune.renderer.scene.scene import Light, Scene
from vpltune.renderer.scene.views import View
from vpltune.window.document import NamedView, PlacedLight
from vpltune.window.layers import LayerPainter
from vpltune.window.requests import (
    DrawnImage,
    DrawRequest,
    Failed,
    Measured,
    MeasureRequest,
    Picked,
    PickRequest,
    SceneCard,
    SceneSource,
)

JPEG_QUALITY = 88
"""Quality of frames in motion. A choice: differences are below what one sees while things move."""
SURFACES_ALONE = TunedConfig(
    ArtistParameters(vpl_count=1, lloyd_iterations=0),
    visibility="transmittance",
    quality=Quality(interleave=1),
    light=ONE_BOUNCE,
)
"""A config that takes no time: of its image only the surfaces are wanted."""
PICK_HEIGHT = 240
"""Rows of the depth image that places are picked in. A choice: a quarter of a degree at 60°."""


def draw_for_window(connection: Connection, source: SceneSource) -> None:
    """Serve requests from `connection` until it is closed. The first answer is a `SceneCard` or `Failed`."""
    try:
        drawing = Drawing(source)
    except (InputError, MachineError) as error:
        connection.send(Failed(source, str(error)))
        return
    connection.send(drawing.card)
    serve(connection, drawing.answer)


def serve(connection: Connection, answer: Callable[[Any], Any]) -> None:
    """Answer requests until the other end is closed; an error of the user's or the machine's is an answer."""
    while True:
        try:
            request = connection.recv()
        except (EOFError, OSError):
            return
        try:
            reply = answer(request)
        except (InputError, MachineError) as error:
            reply = Failed(request, str(error))
        if reply is not None:
            try:
                connection.send(reply)
            except OSError:
                return


class Drawing:
    """A scene, its runtime, and the clip that each client sees.

    Raises:
        InputError: the scene or its sidecar cannot be used.
        MachineError: there is no OpenGL 4.5.
    """

    def __init__(self, source: SceneSource):
        self._scene = source.read()
        self._runtime = Runtime(self._scene)
        self._player = AnimationPlayer(self._scene)
        self._painter = LayerPainter(self._runtime)
        self._clips: dict[tuple[int, str], tuple[int, ClipState]] = {}
        self._posed: float | None = None
        self.card = _card(self._scene, self._runtime, source)

    def answer(self, request: Any) -> Any:
        """The answer to any request; None where there is nothing to say."""
        if isinstance(request, DrawRequest):
            return self._drawn(request)
        if isinstance(request, PickRequest):
            return self._picked(request)
        if isinstance(request, MeasureRequest):
            return self._measured(request)
        return None

    def _drawn(self, request: DrawRequest) -> DrawnImage:
        begin = time.perf_counter()
        lights = self._pose(request.seconds, request.view.lights, request.follows)
        view = replace(request.view, lights=lights)
        state = None if request.settled else self._clip(request)
        if request.settled:
            # The next movement begins with a first frame, as after a cut.
            self._clips.pop((request.client, request.pane), None)
        pixels, parameters = self._painter.paint(request, view, state)
        encoded = b"" if pixels is None else _encoded(pixels, lossless=request.settled)
        return DrawnImage(
            request,
            encoded,
            1e3 * (time.perf_counter() - begin),
            None if request.seconds is None else lights,
            parameters,
        )

    def _clip(self, request: DrawRequest) -> ClipState:
        """What the client's clip carries on; another VPL count begins anew."""
        count = request.config.parameters.vpl_count
        known = self._clips.get((request.client, request.pane))
        if known is None or known[0] != count:
            known = self._clips[request.client, request.pane] = count, ClipState()
        return known[1]

    def _picked(self, request: PickRequest) -> Picked:
        captured = self._painter.seen_by(request.client, request.camera)
        if captured is None:
            self._pose(request.seconds, (), ())
            size = (max(1, round(PICK_HEIGHT * min(request.aspect, 4.0))), PICK_HEIGHT)
            captured = self._runtime.capture(View("pick", "fitted", size, request.camera, ()), SURFACES_ALONE)
        height, width = captured.valid.shape
        row, column = min(int(request.y * height), height - 1), min(int(request.x * width), width - 1)
        if not captured.valid[row, column]:
            return Picked(request, None, None, 0.0)
        position, normal = captured.position_world[row, column], captured.normal_world[row, column]
        distance = float(np.linalg.norm(position - request.camera.position_world))
        return Picked(request, tuple(position.tolist()), tuple(normal.tolist()), distance)

    def _measured(self, request: MeasureRequest) -> Measured:
        passes = self._runtime.pass_milliseconds(request.view, request.config, frames=2)
        whole = self._runtime.frame_milliseconds(request.view, request.config, frames=2)
        return Measured(request, passes, whole)

    def _pose(
        self, seconds: float | None, lights: tuple[Light, ...], follows: tuple[int | None, ...]
    ) -> tuple[Light, ...]:
        """Move the scene to a time, and return the lights as they are then."""
        if self._scene.animation is None:
            return lights
        pose = self._player.rest_pose() if seconds is None else self._player.pose_at(seconds)
        if seconds != self._posed:
            self._runtime.pose(pose)
            self._posed = seconds
        if seconds is None:
            return lights
        return posed_lights(lights, follows, pose)


def posed_lights(lights: tuple[Light, ...], follows: tuple[int | None, ...], pose: Pose) -> tuple[Light, ...]:
    """The lights as a pose has those that follow one of the scene's; a scene read anew may have fewer."""
    return tuple(
        pose.lights[index] if index is not None and index < len(pose.lights) else light
        for light, index in zip(lights, follows, strict=True)
    )


def lower_priority(steps: int) -> None:
    """Let the processes that someone looks at go first; where there are no priorities, nothing happens."""
    if hasattr(os, "nice"):
        os.nice(steps)


def _card(scene: Scene, runtime: Runtime, source: SceneSource) -> SceneCard:
    if source.path is None:
        camera, lights, notes = completed_camera_and_lights(
            scene, Path(scene.name), source.camera, source.lights
        )
    else:
        camera, lights, notes = resolve_camera_and_lights(scene, source.path, source.camera, source.lights)
    low, high = scene.bounds()
    return SceneCard(
        name=scene.name,
        bounds=(tuple(low.tolist()), tuple(high.tolist())),
        seconds=0.0 if scene.animation is None else scene.animation.duration,
        renderer=runtime.opengl_renderer,
        camera=camera,
        lights=tuple(PlacedLight(light, _index_of(light, scene.lights)) for light in lights),
        views=tuple(
            NamedView(each.name or f"camera {index}", "file", each)
            for index, each in enumerate(scene.cameras)
        ),
        notes=(*scene.warnings, *notes),
    )


def _index_of(light: Light, among: tuple[Light, ...]) -> int | None:
    return next((index for index, each in enumerate(among) if each is light), None)


def _encoded(pixels: UInt8[np.ndarray, "height width 3"], *, lossless: bool) -> bytes:
    file = io.BytesIO()
    if lossless:
        # 1: a third of the time of the default, and files go over a loopback.
        Image.fromarray(pixels).save(file, "PNG", compress_level=1)
    else:
        Image.fromarray(pixels).save(file, "JPEG", quality=JPEG_QUALITY)
    return file.getvalue()
