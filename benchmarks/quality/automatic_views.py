"""What automatic views show: background, the largest surface, and the share that only bounced light reaches.

Every scene loses its cameras and lights, and gets placed ones. Figures are shares of the image's pixels,
median and worst over the scenes, and the share of scenes within a bound. Scenes that choose nothing
(docs/chosen_on.md) have rows of their own. The images lie in `out/automatic_views/contact_sheet.png`.
"""

import dataclasses
from collections.abc import Callable, Iterator

import moderngl
import numpy as np
from jaxtyping import Bool, UInt8
from PIL import Image, ImageDraw

from benchmarks.harness.hard_scenes import hard_scenes
from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import (
    CHOOSING_SEED,
    KEPT_AWAY,
    MITSUBA_SCENES,
    REPORTED_SEED,
    REPOSITORY,
    present_scenes,
    scenes_folder,
)
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.image_file import write_png
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.mitsuba_import import read_mitsuba
from vpltune.renderer.scene.placement import default_camera, default_light
from vpltune.renderer.scene.placement.free_places import is_room
from vpltune.renderer.scene.placement.subject import subject_space
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View
from vpltune.tuner.prior.scene_generator import generated_name, generated_scene

SIZE = (160, 90)
"""Width and height of the images in pixels. A choice."""
CONFIG = TunedConfig(
    ArtistParameters(vpl_count=64),
    quality=Quality(interleave=4, map_size=16, map_refinement=1),
    light=ONE_BOUNCE,
)
"""A choice: light enough for a software renderer. The figures do not depend on it."""
GENERATED = 12
"""Scenes of the generator. A choice: two or three of each kind."""
SEEDS = {"": CHOOSING_SEED, "held_out.": REPORTED_SEED}
"""Seeds of the generated scenes, by group."""
BOUNDS = {"background": (0.0, 0.35), "largest_surface": (0.0, 0.6), "bounce_only": (0.3, 0.7)}
"""Bounds of a good view. Choices."""
WANTED = 0.9
"""Share of the scenes that should keep a bound. A choice."""
COLUMNS = 4
"""Images side by side on the contact sheet."""
SAMPLES = 64
"""Pixels whose planes are measured for the largest surface. A surface of half the image has 32 of them."""
# Choices: pixels lie on one plane if their normals differ by less than 6°, and their distance from the plane
# is less than this share of the depth.
SAME_NORMAL, SAME_PLANE = np.cos(np.radians(6.0)), 0.01


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Median, worst and share within the bounds of each figure, against the bound that it should keep."""
    measured: dict[str, list[dict[str, float]]] = {group: [] for group in SEEDS}
    tiles = []
    makers = list(_scenes())
    with create_context() as context:
        for index, (name, group, make) in enumerate(makers):
            progress(f"automatic_views: {name}", index / len(makers))
            image, figures = shown(make(), context)
            measured[group].append(figures)
            tiles.append(_captioned(image, f"{name} {_shares(figures)}"))
    write_png(REPOSITORY / "out" / "automatic_views" / "contact_sheet.png", _sheet(tiles))
    progress("automatic_views", 1.0)
    return [row for group, figures in measured.items() for row in _rows(group, figures)]


def shown(
    scene: Scene, context: moderngl.Context
) -> tuple[UInt8[np.ndarray, "height width 3"], dict[str, float]]:
    """The image of a scene's automatic view, and the figures named in `BOUNDS`.

    The background of an object, in place of a room, is named `open.background`.
    """
    bare = dataclasses.replace(scene, cameras=(), lights=())
    camera, _ = default_camera(bare)
    light, _ = default_light(bare, camera)
    view = View("automatic", "fitted", SIZE, camera, (light,))
    runtime = Runtime(bare, context=context)
    image, captured = runtime.render(view, CONFIG), runtime.capture(view, CONFIG, maps=False)
    figures = {
        "background": 1.0 - float(captured.valid.mean()),
        "largest_surface": largest_surface(captured),
        "bounce_only": bounce_only(captured),
    }
    if not is_room(subject_space(bare)):
        figures["open.background"] = figures.pop("background")
    return image, figures


def bounce_only(captured: CapturedFrame) -> float:
    """Share of the pixels with a surface that no light reaches directly."""
    dark = captured.direct_irradiance.max(axis=2) <= 0.0
    return float(dark[captured.valid].mean()) if captured.valid.any() else 1.0


def largest_surface(captured: CapturedFrame) -> float:
    """Largest share of all pixels that lie on one plane, from the planes through `SAMPLES` of them."""
    seen = np.flatnonzero(captured.valid)
    points = captured.position_world.reshape(-1, 3)[seen].astype(np.float64)
    normals = captured.normal_world.reshape(-1, 3)[seen].astype(np.float64)
    depth = captured.depth.ravel()[seen]
    counts = [0]
    for pixel in range(0, len(seen), max(1, len(seen) // SAMPLES)):
        plane: Bool[np.ndarray, " pixels"] = (normals @ normals[pixel] > SAME_NORMAL) & (
            np.abs((points - points[pixel]) @ normals[pixel]) < SAME_PLANE * depth
        )
        counts.append(int(plane.sum()))
    return max(counts) / captured.valid.size


def _scenes() -> Iterator[tuple[str, str, Callable[[], Scene]]]:
    """Name, group (a key of `SEEDS`) and maker of every scene."""
    for name, path in present_scenes().items():
        yield name, "held_out." if name in KEPT_AWAY else "", lambda path=path: read_scene(path)
    for name, file in MITSUBA_SCENES.items():
        path = scenes_folder() / name / file
        if path.is_file():
            yield name, "", lambda path=path: read_mitsuba(path)
    for name, make in hard_scenes().items():
        yield name, "", make
    for group, seed in SEEDS.items():
        for number in range(GENERATED):
            yield (
                f"{generated_name(number)} of {seed}",
                group,
                lambda number=number, seed=seed: generated_scene(number, seed),
            )


def _rows(group: str, scenes: list[dict[str, float]]) -> Iterator[Row]:
    for name in ("background", "open.background", "largest_surface", "bounce_only"):
        values = [figures[name] for figures in scenes if name in figures]
        if not values:
            continue
        low, high = BOUNDS[name.removeprefix("open.")]
        worst = max(values, key=lambda value: max(low - value, value - high))
        kept = float(np.mean([low <= value <= high for value in values]))
        yield Row(
            f"{group}{name}.median",
            float(np.median(values)),
            "1",
            f"bounds {low:g} to {high:g}; the upper",
            high,
        )
        yield Row(f"{group}{name}.worst", worst, "1", f"bounds {low:g} to {high:g}; the upper", high)
        yield Row(f"{group}{name}.scenes_within_bounds", kept, "1", "wanted", WANTED)


def _shares(figures: dict[str, float]) -> str:
    """Background, largest surface and bounce only, in percent."""
    background = figures.get("background", figures.get("open.background", 0.0))
    shares = (background, figures["largest_surface"], figures["bounce_only"])
    return " ".join(f"{100.0 * share:.0f}" for share in shares)


def _captioned(image: UInt8[np.ndarray, "height width 3"], text: str) -> UInt8[np.ndarray, "tall width 3"]:
    """The image with a line of text below."""
    page = Image.new("RGB", (image.shape[1] + 2, image.shape[0] + 14))
    page.paste(Image.fromarray(image), (0, 0))
    ImageDraw.Draw(page).text((2, image.shape[0] + 1), text[:40], fill=(255, 255, 255))
    return np.asarray(page)


def _sheet(tiles: list[UInt8[np.ndarray, "tall width 3"]]) -> UInt8[np.ndarray, "height width 3"]:
    """The tiles in rows of `COLUMNS`."""
    blank = np.zeros_like(tiles[0])
    padded = tiles + [blank] * (-len(tiles) % COLUMNS)
    return np.concatenate(
        [np.concatenate(padded[i : i + COLUMNS], axis=1) for i in range(0, len(padded), COLUMNS)]
    )
