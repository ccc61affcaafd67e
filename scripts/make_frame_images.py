"""Draw docs/frame_buffers.png: every buffer of one frame of the gallery, in the order of the frame.

python scripts/make_frame_images.py
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.image_file import write_png
from vpltune.renderer.files.srgb import srgb_from_linear
from vpltune.renderer.frame.capture import CapturedFrame, octahedral_decode, read_image
from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.light_motion import BouncingLights, flux_beside
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.views import View

REPOSITORY = Path(__file__).resolve().parents[1]
SCENE = REPOSITORY / "configs" / "scenes" / "gallery.glb"
IMAGE = REPOSITORY / "docs" / "frame_buffers.png"
SIZE = (272, 204)
COLUMNS = 4
LABEL_HEIGHT = 22
DYNAMIC_LIGHTS = 60
VPL_RADIUS = 1.6
"""The radius of a dot, in pixels."""


def main() -> None:
    scene = read_scene(SCENE)
    camera, lights, _ = resolve_camera_and_lights(scene, SCENE, None, None)
    view = View("frame", "fitted", SIZE, camera, lights)
    config = TunedConfig(ArtistParameters(screen_space_strength=1.0))
    runtime = Runtime(scene, RuntimeOptions(light_path="tiles"))
    moving = BouncingLights(scene, DYNAMIC_LIGHTS, 3, 0.5 * flux_beside(scene, lights))
    dynamic = DynamicLights(moving.records)
    drawn = runtime.draw(view, config, lights=dynamic)
    captured = drawn.capture()
    cells = _buffers(drawn.frame, dynamic)
    shown = {name: _display(runtime, irradiance) for name, irradiance in _irradiance(captured).items()}
    dots = _with_dots(shown["direct irradiance"], view, captured.vpl_position_world, captured.vpl_flux)
    cells |= {"1,024 VPLs, over direct irradiance": dots} | shown
    cells["final"] = runtime.render(view, config, lights=dynamic)
    write_png(IMAGE, np.asarray(_sheet(cells)))


def _buffers(frame: Frame, dynamic: DynamicLights) -> dict[str, np.ndarray]:
    def read(name: str) -> np.ndarray:
        return read_image(frame.resources, name)

    return {
        "G-buffer: depth": _depth(read("gbuffer_depth")),
        "G-buffer: normal": _normal(read("gbuffer_normal"), read("gbuffer_depth")),
        "G-buffer: albedo": _srgb(read("gbuffer_albedo")),
        f"light accumulation ({len(dynamic)} lights)": _srgb(
            read("light_accumulation") * dynamic.accumulation_unit * 0.15
        ),
        "RSM: depth": _depth(read("rsm_depth")),
        "RSM: normal": _normal(read("rsm_normal"), read("rsm_depth")),
        "RSM: reflectance": _srgb(read("rsm_reflectance")),
    }


def _irradiance(captured: CapturedFrame) -> dict[str, np.ndarray]:
    vpls = captured.vpl_irradiance
    return {
        "direct irradiance": captured.direct_irradiance,
        "indirect irradiance of the VPLs": vpls,
        "its near field, in screen space": np.maximum(captured.indirect_irradiance - vpls, 0.0),
    }


def _display(runtime: Runtime, irradiance: np.ndarray) -> np.ndarray:
    return runtime.display(np.ascontiguousarray(irradiance))


def _depth(stored: np.ndarray) -> np.ndarray:
    """Reversed depth, nearest over distance: white is nearest, black is nothing."""
    nearest = stored.max() if stored.any() else 1.0
    return np.repeat((stored / nearest)[..., None], 3, axis=2)


def _normal(stored: np.ndarray, depth: np.ndarray) -> np.ndarray:
    return np.where(depth[..., None] > 0.0, 0.5 + 0.5 * octahedral_decode(stored), 0.0)


def _srgb(linear: np.ndarray) -> np.ndarray:
    return srgb_from_linear(np.clip(linear[..., :3].astype(np.float32), 0.0, 1.0))


def _with_dots(image: np.ndarray, view: View, positions: np.ndarray, flux: np.ndarray) -> np.ndarray:
    """A dot at each VPL that the camera faces, in the colour of its flux; what hides it is not asked."""
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


def _sheet(cells: dict[str, np.ndarray]) -> Image.Image:
    rows = -(-len(cells) // COLUMNS)
    width, height = SIZE[0], SIZE[1] + LABEL_HEIGHT
    sheet = Image.new("RGB", (COLUMNS * width, rows * height), "white")
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(14)
    for index, (name, image) in enumerate(cells.items()):
        left, top = index % COLUMNS * width, index // COLUMNS * height
        if image.dtype != np.uint8:
            image = np.round(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)
        image = Image.fromarray(image)
        # RSM faces are square: shown whole, with white beside them.
        image.thumbnail(SIZE, Image.Resampling.BOX)
        sheet.paste(image, (left, top + LABEL_HEIGHT))
        draw.text((left + 4, top + 3), name, fill="black", font=font)
    return sheet


if __name__ == "__main__":
    main()
