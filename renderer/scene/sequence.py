"""A scene over time: the view and the pose at every frame of a clip."""

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.animation import AnimationPlayer, Pose
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.views import View, scaled_view

Motion = Literal["auto", "none", "light", "camera", "both"]
MOTIONS: tuple[Motion, ...] = get_args(Motion)
"""Every value of `Motion`."""

MOTION_SECONDS = 8.0
"""A choice: period of the added motions in seconds. A clip of this length loops seamlessly."""
LIGHT_TURN = math.radians(15.0)
"""A choice: half angle of the cone on which the direction of a spot or directional light circles, radians."""
LIGHT_SWAY = 0.04
"""A choice: radius of the circle that a point light moves on, in scene diagonals."""
CAMERA_TURN = math.radians(10.0)
"""A choice: how far the camera swings to either side around its target, radians."""


@dataclass(frozen=True, eq=False)
class Moment:
    """One frame of a sequence."""

    view: View
    pose: Pose
    """Transforms of instances and joints. Use the lights and the camera of `view`, not those of the pose."""


class Sequence:
    """A scene's animation, plus an optional added motion of the lights and the camera.

    Args:
        scene: the scene, at its original scale.
        view: the starting view. Its camera and lights follow the animation if they are the very objects in
            `scene.cameras` and `scene.lights`.
        motion: what moves in addition. "auto" is "both" if the scene has no animation, else "none".
        factor: moments are those of the scene scaled by this factor.
    """

    def __init__(self, scene: Scene, view: View, motion: Motion = "auto", factor: float = 1.0):
        self._view = view
        self._factor = factor
        self._player = AnimationPlayer(scene)
        self._followed_lights = [_index_of(light, scene.lights) for light in view.lights]
        self._followed_camera = _index_of(view.camera, scene.cameras)
        if motion == "auto":
            motion = "both" if scene.animation is None else "none"
        self._light_moves = motion in ("light", "both")
        self._camera_moves = motion in ("camera", "both")
        low, high = scene.bounds()
        self._diagonal = float(np.linalg.norm(high - low))
        self._target = _looked_at(view.camera, (low + high) / 2.0)

    def at(self, seconds: float) -> Moment:
        """The moment `seconds` after the start.

        Raises:
            InputError: a world matrix of the animation exceeds the range of coordinates.
        """
        pose = self._player.pose_at(seconds)
        camera = self._view.camera if self._followed_camera is None else pose.cameras[self._followed_camera]
        lights = tuple(
            light if followed is None else pose.lights[followed]
            for light, followed in zip(self._view.lights, self._followed_lights, strict=True)
        )
        phase = 2.0 * math.pi * seconds / MOTION_SECONDS
        if self._light_moves:
            lights = tuple(_circled(light, phase, LIGHT_SWAY * self._diagonal) for light in lights)
        if self._camera_moves:
            camera = _swung(camera, self._target, CAMERA_TURN * math.sin(phase))
        view = replace(self._view, camera=camera, lights=lights)
        if self._factor == 1.0:
            return Moment(view, pose)
        grow = np.diag([self._factor, self._factor, self._factor, 1.0])
        transforms, joint_matrices = grow @ pose.transforms, grow @ pose.joint_matrices
        grown = replace(pose, transforms=transforms, joint_matrices=joint_matrices)
        return Moment(scaled_view(view, self._factor), grown)


def _index_of(wanted: object, among: tuple) -> int | None:
    return next((index for index, item in enumerate(among) if item is wanted), None)


def _looked_at(camera: Camera, center: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
    """The point in front of the camera, on its axis, that is nearest to the centre of the scene.

    It is at least a quarter of the distance to the centre away.
    """
    forward = -camera.to_world[:3, 2]
    distance = float(np.dot(center - camera.position_world, forward))
    reach = float(np.linalg.norm(center - camera.position_world))
    return camera.position_world + max(distance, 0.25 * reach) * forward


def _circled(light: Light, phase: float, radius: float) -> Light:
    """The light at `phase` (radians) of its circle; phase 0 is the light unchanged."""
    if light.kind == "point":
        offset = radius * np.array([math.cos(phase) - 1.0, 0.0, math.sin(phase)])
        return replace(light, position_world=light.position_world + offset)
    down = light.direction_world
    helper = np.array([1.0, 0.0, 0.0]) if abs(down[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across = np.cross(down, helper)
    across /= np.linalg.norm(across)
    aside = math.cos(phase) - 1.0, math.sin(phase)
    turned = down + math.tan(LIGHT_TURN) * (aside[0] * across + aside[1] * np.cross(down, across))
    return replace(light, direction_world=turned / np.linalg.norm(turned))


def _swung(camera: Camera, target: Float64[np.ndarray, "3"], angle: float) -> Camera:
    """The camera rotated by `angle` (radians) about the vertical axis through `target`."""
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.eye(4)
    turn[:3, :3] = [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
    turn[:3, 3] = target - turn[:3, :3] @ target
    return replace(camera, to_world=turn @ camera.to_world)
