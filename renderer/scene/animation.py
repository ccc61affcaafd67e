"""Animation playback: the transforms of instances, joints, lights and cameras at a given time."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files.limits import LARGEST_COORDINATE
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.scene_animation import Animation, Channel
from vpltune.renderer.scene.transforms import trs_matrices, without_scale

# Radians. Below this angle, slerp divides by a sine near zero, so it interpolates linearly instead. The chord
# then differs from the arc by less than 1e-8.
_SMALLEST_ARC = 1e-4


@dataclass(frozen=True, eq=False)
class Pose:
    """A scene at one moment. Whatever no channel moves is as in `Scene`."""

    transforms: Float64[np.ndarray, "instances 4 4"]
    """Instance to world; the identity for instances that a skin places."""
    joint_matrices: Float64[np.ndarray, "joints 4 4"]
    """World matrix times inverse bind matrix of each joint, skin after skin."""
    lights: tuple[Light, ...]
    cameras: tuple[Camera, ...]


class AnimationPlayer:
    """Computes the pose of a scene at any time. Every clip loops forever, with its own period.

    It evaluates all channels of the same kind at once, and the hierarchy one level at a time.
    """

    def __init__(self, scene: Scene):
        self._scene = scene
        animation = scene.animation
        if animation is None:
            return
        self._tracks = _tracks(animation.channels)
        self._levels = _levels(animation)
        moved = np.unique([channel.node for channel in animation.channels])
        self._moved = moved.astype(np.int64)
        self._joints = np.concatenate([skin.joints for skin in animation.skins] or [np.zeros(0, np.int32)])
        self._inverse_bind = np.concatenate(
            [skin.inverse_bind for skin in animation.skins] or [np.zeros((0, 4, 4))]
        )
        self._rest_transforms = np.array([instance.to_world for instance in scene.instances])

    def pose_at(self, seconds: float) -> Pose:
        """The pose `seconds` after the start.

        Raises:
            InputError: a world matrix exceeds the range of coordinates, `LARGEST_COORDINATE` times the scale
                of `Animation.root_to_world`.
        """
        return self._pose(seconds)

    def rest_pose(self) -> Pose:
        """The pose without animation: that of the scene file's nodes."""
        return self._pose(None)

    def _pose(self, seconds: float | None) -> Pose:
        scene, animation = self._scene, self._scene.animation
        if animation is None:
            at_rest = np.array([instance.to_world for instance in scene.instances])
            return Pose(at_rest, np.zeros((0, 4, 4)), scene.lights, scene.cameras)
        world = self._world_matrices(animation, seconds)
        is_hung = animation.instance_nodes >= 0
        transforms = self._rest_transforms.copy()
        transforms[is_hung] = world[animation.instance_nodes[is_hung]] @ animation.instance_local[is_hung]
        return Pose(
            transforms,
            world[self._joints] @ self._inverse_bind,
            tuple(
                _placed_light(light, world[node])
                for light, node in zip(scene.lights, animation.light_nodes, strict=True)
            ),
            tuple(
                _placed_camera(camera, world[node])
                for camera, node in zip(scene.cameras, animation.camera_nodes, strict=True)
            ),
        )

    def _world_matrices(
        self, animation: Animation, seconds: float | None
    ) -> Float64[np.ndarray, "nodes 4 4"]:
        local = animation.rest_local.copy()
        if seconds is not None:
            local[self._moved] = self._moved_local(animation, seconds)
        world = np.empty_like(local)
        for level, rows in enumerate(self._levels):
            above = world[animation.parents[rows]] if level else animation.root_to_world
            world[rows] = above @ local[rows]
        # Above the nodes stands the scale at which the scene is drawn. The limit is one of the file's units.
        scale = abs(float(np.linalg.det(animation.root_to_world[:3, :3]))) ** (1 / 3)
        if not np.abs(world).max(initial=0.0) <= LARGEST_COORDINATE * scale:
            raise InputError(
                f"{self._scene.name}: its animation must stay within {LARGEST_COORDINATE:g}, "
                f"which it leaves {'at rest' if seconds is None else f'at {seconds} s'}"
            )
        return world

    def _moved_local(self, animation: Animation, seconds: float) -> Float64[np.ndarray, "moved 4 4"]:
        parts = {
            "translation": animation.rest_translation.copy(),
            "rotation": animation.rest_rotation.copy(),
            "scale": animation.rest_scale.copy(),
        }
        for track in self._tracks:
            parts[track.animated][track.nodes] = track.values_at(seconds)
        return trs_matrices(*(part[self._moved] for part in parts.values()))


@dataclass(frozen=True, eq=False)
class _Track:
    """Channels with the same property, interpolation and number of keys, evaluated together."""

    animated: str
    interpolation: str
    nodes: Int64[np.ndarray, " channels"]
    durations: Float64[np.ndarray, " channels"]
    times: Float64[np.ndarray, "channels keys"]
    values: Float64[np.ndarray, "channels keys components"]
    tangents: Float64[np.ndarray, "channels keys 2 components"] | None

    def values_at(self, seconds: float) -> Float64[np.ndarray, "channels components"]:
        """The channels' values (glTF 2.0 appendix C), constant before the first key and after the last."""
        time = np.zeros_like(self.durations)
        np.mod(seconds, self.durations, out=time, where=self.durations > 0.0)
        key_count = self.times.shape[1]
        before = np.clip((self.times <= time[:, None]).sum(axis=1) - 1, 0, key_count - 1)
        after = np.minimum(before + 1, key_count - 1)
        row = np.arange(len(time))
        first, second = self.values[row, before], self.values[row, after]
        if self.interpolation == "step":
            return first
        span = self.times[row, after] - self.times[row, before]
        share = np.zeros_like(time)
        np.divide(time - self.times[row, before], span, out=share, where=span > 0.0)
        share = np.clip(share, 0.0, 1.0)[:, None]
        if self.tangents is not None:
            leaving, arriving = self.tangents[row, before, 1], self.tangents[row, after, 0]
            value = _hermite(first, leaving, second, arriving, share, span[:, None])
            return _never_zero(value, first) if self.animated == "rotation" else value
        if self.animated == "rotation":
            return slerp(first, second, share)
        return first + share * (second - first)


def slerp(
    first: Float64[np.ndarray, "n 4"], second: Float64[np.ndarray, "n 4"], share: Float64[np.ndarray, "n 1"]
) -> Float64[np.ndarray, "n 4"]:
    """Spherical interpolation of quaternions along the shorter arc at constant speed (Shoemake 1985).

    Args:
        first: quaternions (x, y, z, w) of any non-zero length.
        second: likewise.
        share: 0 gives `first`, 1 gives `second` or its negative.

    Returns:
        Unit quaternions, to within 1e-8.
    """
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    second = second / np.linalg.norm(second, axis=1, keepdims=True)
    cosine = np.sum(first * second, axis=1, keepdims=True)
    # q and −q are the same rotation; take the nearer one.
    second = np.where(cosine < 0.0, -second, second)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.where(angle < _SMALLEST_ARC, 1.0, np.sin(angle))
    is_arc = angle >= _SMALLEST_ARC
    from_first = np.where(is_arc, np.sin((1.0 - share) * angle) / sine, 1.0 - share)
    from_second = np.where(is_arc, np.sin(share * angle) / sine, share)
    return from_first * first + from_second * second


def _hermite(
    first: np.ndarray,
    leaving: np.ndarray,
    second: np.ndarray,
    arriving: np.ndarray,
    share: np.ndarray,
    span: np.ndarray,
) -> np.ndarray:
    """Cubic Hermite spline (glTF 2.0 appendix C.5). Tangents are per second, `span` is in seconds."""
    square, cube = share**2, share**3
    return (
        (2.0 * cube - 3.0 * square + 1.0) * first
        + span * (cube - 2.0 * square + share) * leaving
        + (3.0 * square - 2.0 * cube) * second
        + span * (cube - square) * arriving
    )


def _never_zero(quaternions: np.ndarray, before: np.ndarray) -> np.ndarray:
    """The quaternions, with `before` in place of zero ones: a spline may pass through zero."""
    return np.where(np.linalg.norm(quaternions, axis=1, keepdims=True) > 0.0, quaternions, before)


def _tracks(channels: tuple[Channel, ...]) -> list[_Track]:
    groups: dict[tuple[str, str, int], list[Channel]] = {}
    for channel in channels:
        key = (channel.animated, channel.interpolation, len(channel.times))
        groups.setdefault(key, []).append(channel)
    return [
        _Track(
            animated,
            interpolation,
            np.array([channel.node for channel in group], np.int64),
            np.array([channel.duration for channel in group], np.float64),
            np.stack([channel.times for channel in group]),
            np.stack([channel.values for channel in group]),
            np.stack([each.tangents for each in group if each.tangents is not None])
            if interpolation == "cubic_spline"
            else None,
        )
        for (animated, interpolation, _), group in groups.items()
    ]


def _levels(animation: Animation) -> list[Int64[np.ndarray, " rows"]]:
    """Node indices grouped by depth, so that the parents of each level are in the level above."""
    depth = np.zeros(len(animation.parents), np.int64)
    for row, parent in enumerate(animation.parents):
        depth[row] = depth[parent] + 1 if parent >= 0 else 0
    return [np.flatnonzero(depth == level) for level in range(int(depth.max(initial=0)) + 1)]


def _placed_light(light: Light, to_world: Float64[np.ndarray, "4 4"]) -> Light:
    length = np.linalg.norm(to_world[:3, 2])
    if light.kind == "point" or not length > 0.0:
        return replace(light, position_world=to_world[:3, 3].copy())
    return replace(light, position_world=to_world[:3, 3].copy(), direction_world=-to_world[:3, 2] / length)


def _placed_camera(camera: Camera, to_world: Float64[np.ndarray, "4 4"]) -> Camera:
    rigid = without_scale(to_world)
    return camera if rigid is None else replace(camera, to_world=rigid)
