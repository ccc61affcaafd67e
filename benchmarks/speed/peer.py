"""The shipped default config, untuned, against another renderer tuned by hand on each of two real scenes.

The peer is Babylon.js 9.34's GIRSM (global illumination by reflective shadow maps). It was measured in a
headless browser on the same two views, with a hard-edged spot of 120 degrees. The figures are its relMSE and
energy ratio of indirect irradiance, at its defaults and at the best settings found for that scene: radius and
intensity searched by hand, or intensity fitted. A black image scores a relMSE of 0.88 and 0.83. The settings
tuned on one scene score 0.86 and 0.74 on the other.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import OUTSIDE_SCENES, scenes_folder
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import read_config
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.scene import Camera, Light
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View
from vpltune.tuner.evaluation.prepare_scene import MAX_SAMPLES, NOISE_TARGET
from vpltune.tuner.metrics.view_metrics import energy_ratio, relmse
from vpltune.tuner.reference import noise_floor, reference_views
from vpltune.tuner.surrogate.captured_view import capture_views

SIZE = (160, 90)
"""Width and height of the image in pixels. A choice."""
INTENSITY = 10.0
"""Radiant intensity of the spot [W/sr]. A choice: relMSE does not depend on it."""
CONE = math.radians(60.0)
"""Inner and outer half angle of the spot: its edge is hard, as it was for the peer."""


@dataclass(frozen=True)
class PeerScene:
    """A view of a scene, and the peer's relMSE and energy ratio there."""

    name: str
    light_position: tuple[float, float, float]
    light_direction: tuple[float, float, float]
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    yfov_degrees: float
    peer_default: tuple[float, float]
    peer_tuned: tuple[float, float]


PEER_SCENES = (
    PeerScene(
        "kajiya-cornell-box",
        (0.0, 1.9, 0.2),
        (0.35, -1.0, -0.1),
        (0.0, 0.995, 3.9),
        (0.0, 0.995, 0.0),
        37.0,
        (130.0, 3.3),
        (0.48, 0.40),
    ),
    PeerScene(
        "godot-living-room",
        (0.3, 3.3, 0.2),
        (-0.4, -1.0, 0.1),
        (3.6, 2.7, -1.7),
        (-2.0, 1.7, 0.9),
        65.0,
        (1092.0, 5.7),
        (0.09, 0.72),
    ),
)


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """relMSE and energy ratio of the shipped defaults against the peer's; nothing is fitted to the scenes."""
    measured = []
    for index, scene in enumerate(PEER_SCENES):
        progress("peer", index / len(PEER_SCENES))
        path = scenes_folder() / scene.name / OUTSIDE_SCENES[scene.name]
        if path.is_file():
            measured += _rows_of(scene)
    progress("peer", 1.0)
    return measured


def _rows_of(scene: PeerScene) -> list[Row]:
    loaded = read_scene(scenes_folder() / scene.name / OUTSIDE_SCENES[scene.name])
    view = View(scene.name, "fitted", SIZE, _camera(scene), (_light(scene),))
    references = reference_views(
        loaded, (view,), seed=0, noise_target=NOISE_TARGET, max_samples=MAX_SAMPLES, bounces=1
    )
    (captured,) = capture_views(
        Runtime(loaded), replace(read_config("default"), light=ONE_BOUNCE), (view,), references
    )
    drawn = captured.captured.indirect_irradiance[captured.valid]
    truth = references[0].irradiance[captured.valid]
    error, energy = relmse(drawn, truth), energy_ratio(drawn, truth)
    tuned_error, tuned_energy = scene.peer_tuned
    default_error, _ = scene.peer_default
    return [
        Row(f"{scene.name}.relmse", error, "1", "the peer, tuned on this scene", tuned_error),
        Row(f"{scene.name}.relmse_untuned", error, "1", "the peer at its defaults", default_error),
        Row(f"{scene.name}.energy_ratio", energy, "1", "the peer, tuned on this scene", tuned_energy),
        Row(f"{scene.name}.noise_floor", noise_floor(references[0]), "1", "relMSE above", error),
    ]


def _camera(scene: PeerScene) -> Camera:
    return Camera(look_at(np.array(scene.eye), np.array(scene.target)), math.radians(scene.yfov_degrees))


def _light(scene: PeerScene) -> Light:
    direction = np.array(scene.light_direction)
    position = np.array(scene.light_position)
    return Light("spot", np.full(3, INTENSITY), position, direction / np.linalg.norm(direction), CONE, CONE)
