"""What tests of exports export, and the stand-alone reader that reads it."""

import dataclasses
from pathlib import Path

import numpy as np
from built_scenes import colored_room
from point_vpls import point_vpls

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.scene.scene import Texture

READER = Path(__file__).resolve().parents[2] / "examples" / "standalone_reader.py"
SCENES = READER.parents[1] / "configs" / "scenes"
CONFIG = TunedConfig(
    point_vpls(
        intensity=1.3, falloff_footprint=0.8, extinction_coefficient=0.4, vpl_count=200, density_exponent=0.7
    ),
    visibility="transmittance",
    quality=Quality(rsm_resolution=256),
    light=ONE_BOUNCE,
)
"""One bounce: exports draw no more."""


def with_resolution(config: TunedConfig, texels: int) -> TunedConfig:
    """With so many texels along the side of an RSM face."""
    return dataclasses.replace(config, quality=dataclasses.replace(config.quality, rsm_resolution=texels))


def with_parameters(config: TunedConfig, **changes: float) -> TunedConfig:
    """With some parameters changed."""
    return config.with_parameters(dataclasses.replace(config.parameters, **changes))


def textured_room():
    """The room with a texture on its coloured walls: repeated, mirrored, minified."""
    room = colored_room()
    v, u = np.mgrid[0:32, 0:32] * (2.0 * np.pi / 32)
    waves = np.stack([np.sin(u), np.cos(v), np.sin(u + v)], axis=-1)
    texels = np.round(160.0 + 90.0 * waves).astype(np.uint8)
    coordinates = np.float32([[0, 0], [3, 0], [3, 2], [0, 2]])
    return dataclasses.replace(
        room,
        textures=(
            Texture("repeated", texels),
            Texture("mirrored", texels, "mirrored_repeat", "clamp_to_edge"),
        ),
        materials=tuple(
            dataclasses.replace(material, texture=texture)
            for material, texture in zip(room.materials, (None, 0, 1), strict=True)
        ),
        meshes=tuple(dataclasses.replace(mesh, uv=coordinates) for mesh in room.meshes),
    )
