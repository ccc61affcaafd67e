"""Draw docs/frame_buffers.png: every buffer of one frame of the gallery, in the order of the passes.

Run `python scripts/make_frame_images.py`.
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.image_file import write_png
from vpltune.renderer.files.srgb import srgb_from_linear
from vpltune.renderer.frame.capture import read_image
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.gpu.octahedral import octahedral_decode
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.light_motion import BouncingLights, flux_beside
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.views import View

REPOSITORY = Path(__file__).resolve().parents[1]
SCENE = REPOSITORY / "configs" / "scenes" / "gallery.glb"
IMAGE = REPOSITORY / "docs" / "frame_buffers.png"
SIZE = (272, 204)
"""Width and height of one buffer's image in pixels. A choice."""
COLUMNS = 4
"""Images side by side. A choice."""
LABEL_HEIGHT = 22
"""Pixels for the label above an image. A choice."""
LABEL_SIZE = 14
"""Height of the label's font in pixels. A choice."""
DYNAMIC_LIGHTS = 60
"""Dynamic lights of the frame. A choice: few enough to tell them apart."""
LIGHTS_SEED = 3
"""Seed of their places and colours. A choice."""
LIGHTS_FLUX = 0.5
"""Their flux over that of lights which stand out beside the scene's own (`flux_beside`). A choice."""
ACCUMULATION_EXPOSURE = 0.15
"""Exposure of the light accumulation [1/(W/m²)]. A choice."""
VPL_RADIUS = 1.6
"""Radius of a VPL's dot in pixels. A choice."""


def main() -> None:
    """Draw the frame, and write the sheet of its buffers."""
    scene = read_scene(SCENE)
    camera, lights, _ = resolve_camera_and_lights(scene, SCENE, None, None)
    view = View("frame", "fitted", SIZE, camera, lights)
    config = TunedConfig(ArtistParameters(screen_space_strength=1.0), light=ONE_BOUNCE)
    runtime = Runtime(scene, RuntimeOptions(light_path="tiles"))
    flux = LIGHTS_FLUX * flux_beside(scene, lights)
    dynamic = DynamicLights(BouncingLights(scene, DYNAMIC_LIGHTS, LIGHTS_SEED, flux).records)
    final = runtime.render(view, config, lights=dynamic)
    drawn = runtime.draw(view, config, lights=dynamic)
    captured = drawn.capture(maps=False)
    images = _buffers(drawn.frame.resources, dynamic)
    irradiance = {
        "direct irradiance": captured.direct_irradiance,
        "indirect irradiance of the VPLs": captured.vpl_irradiance,
        "its near field, in screen space": np.maximum(
            captured.indirect_irradiance - captured.vpl_irradiance, 0.0
        ),
    }
    # `display` draws into a frame of its own, after everything has been read.
    shown = {name: runtime.display(np.ascontiguousarray(image)) for name, image in irradiance.items()}
    dots = _with_dots(shown["direct irradiance"], view, captured.vpl_position_world, captured.vpl_flux)
    images |= {f"{len(captured.vpl_flux):,} VPLs, over direct irradiance": dots} | shown
    write_png(IMAGE, np.asarray(_sheet(images | {"final": final})))


def _buffers(resources: Resources, dynamic: DynamicLights) -> dict[str, np.ndarray]:
    """The buffers of the first passes as images, by label."""

    def read(name: str) -> np.ndarray:
        return read_image(resources, name)

    light = read("light_accumulation") * dynamic.accumulation_unit
    return {
        "G-buffer: depth": _depth(read("gbuffer_depth")),
        "G-buffer: normal": _normal(read("gbuffer_normal"), read("gbuffer_depth")),
        "G-buffer: albedo": _srgb(read("gbuffer_albedo")),
        f"light accumulation ({len(dynamic)} lights)": _srgb(ACCUMULATION_EXPOSURE * light),
        "RSM: depth": _depth(read("rsm_depth")),
        "RSM: normal": _normal(read("rsm_normal"), read("rsm_depth")),
        "RSM: reflectance": _srgb(read("rsm_reflectance")),
    }


def _depth(stored: np.ndarray) -> np.ndarray:
    """Reversed depth in grey: the nearest surface is white, and where there is none the image is black."""
    nearest = stored.max() if stored.any() else 1.0
    return np.repeat((stored / nearest)[..., None], 3, axis=2)


def _normal(stored: np.ndarray, depth: np.ndarray) -> np.ndarray:
    return np.where(depth[..., None] > 0.0, 0.5 + 0.5 * octahedral_decode(stored), 0.0)


def _srgb(linear: np.ndarray) -> np.ndarray:
    return srgb_from_linear(np.clip(linear[..., :3].astype(np.float32), 0.0, 1.0))


def _with_dots(image: np.ndarray, view: View, positions: np.ndarray, flux: np.ndarray) -> np.ndarray:
    """Draw a dot at each VPL before the camera, in the colour of its flux, even if a surface hides it."""
    dimmed = Image.fromarray(image // 2)
    draw = ImageDraw.Draw(dimmed)
    to_camera = view.camera.world_to_camera
    placed = positions @ to_camera[:3, :3].T + to_camera[:3, 3]
    focal = 0.5 * view.size[1] / np.tan(view.camera.yfov / 2.0)
    colors = np.round(255.0 * _srgb(flux / flux.max(axis=1, keepdims=True))).astype(int)
    for (x, y, z), color in zip(placed, colors, strict=True):
        if z < 0.0:
            u, v = view.size[0] / 2.0 - focal * x / z, view.size[1] / 2.0 + focal * y / z
            box = (u - VPL_RADIUS, v - VPL_RADIUS, u + VPL_RADIUS, v + VPL_RADIUS)
            draw.ellipse(box, fill=tuple(color.tolist()))
    return np.asarray(dimmed)


def _sheet(images: dict[str, np.ndarray]) -> Image.Image:
    """All images in a grid, with their labels above them."""
    rows = -(-len(images) // COLUMNS)
    width, height = SIZE[0], SIZE[1] + LABEL_HEIGHT
    sheet = Image.new("RGB", (COLUMNS * width, rows * height), "white")
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(LABEL_SIZE)
    for index, (name, image) in enumerate(images.items()):
        left, top = index % COLUMNS * width, index // COLUMNS * height
        if image.dtype != np.uint8:
            image = np.round(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)
        image = Image.fromarray(image)
        # RSM faces are square: white fills the rest.
        image.thumbnail(SIZE, Image.Resampling.BOX)
        sheet.paste(image, (left, top + LABEL_HEIGHT))
        draw.text((left + 4, top + 3), name, fill="black", font=font)
    return sheet


if __name__ == "__main__":
    main()
