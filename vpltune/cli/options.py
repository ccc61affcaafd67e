"""Arguments and options that several commands share, and the parsers of their values.

This module imports nothing heavier than typer, so that `vpltune --help` answers at once.
"""

import math
import re
from pathlib import Path
from typing import Annotated, Literal

import typer

from vpltune.renderer.errors import InputError

LARGEST_SIDE = 16384
"""Largest side of an image, in pixels; views.json has the same limit."""

LARGEST_VIEW_COUNT = 64
"""Most fitted views. A choice."""
VIEW_COUNT = 4
"""Default number of fitted views. A choice: with validation and held-out views, ten light positions."""

SCENE_SECONDS = 900.0
"""Default time limit of an attempt in a batch. A choice: many times what the slowest known scene takes."""

Layer = Literal["final", "direct", "indirect", "irradiance", "albedo", "normal", "depth"]
Motion = Literal["auto", "none", "light", "camera", "both"]

SceneArgument = Annotated[
    Path, typer.Argument(metavar="SCENE", help="A .gltf, .glb, .obj or .ply file.", show_default=False)
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on stdout, everything else on stderr.")
]
VisibilityOption = Annotated[
    Literal["transmittance", "maps"] | None,
    typer.Option(help="What occludes VPLs; overrides the config.", show_default=False),
]
InterleaveOption = Annotated[
    str | None,
    typer.Option(
        metavar="auto|1|2|4|8",
        help="Divide the VPLs among the pixels of NxN blocks, which is faster; overrides the config.",
        show_default=False,
    ),
]
MapSizeOption = Annotated[
    int | None,
    typer.Option(
        metavar="TEXELS",
        help="Resolution of a VPL's visibility map, from 4 to 64; overrides the config.",
        show_default=False,
    ),
]
MapRefinementOption = Annotated[
    int | None,
    typer.Option(
        metavar="1|2|4|8",
        help="Factor by which visibility maps are finer at silhouettes; overrides the config.",
        show_default=False,
    ),
]
RsmResolutionOption = Annotated[
    int | None,
    typer.Option(
        metavar="TEXELS",
        help="Resolution of a light's reflective shadow map, from 64 to 8192; overrides the config.",
        show_default=False,
    ),
]
StartOption = Annotated[
    str,
    typer.Option(
        "--config", metavar="START.json", help="Start from this config: a file, `default` or `auto`."
    ),
]
ViewsOrFileOption = Annotated[
    str,
    typer.Option(
        "--views",
        metavar="N|FILE",
        help="Number of fitted views; as many validate the fit, and half as many are held out. Or a "
        "views.json with views of your own.",
    ),
]
ViewCountOption = Annotated[
    int,
    typer.Option(
        "--views",
        min=1,
        max=LARGEST_VIEW_COUNT,
        help="Number of fitted views; as many validate the fit, and half as many are held out.",
    ),
]
BouncesOption = Annotated[
    str | None,
    typer.Option(
        metavar="N|all",
        help="Reflections of light, at most: 1 to 64, or all of them; overrides the config.",
        show_default=False,
    ),
]
SkyLightsOption = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Directional lights that stand for a sky, from 1 to 256; overrides the config.",
        show_default=False,
    ),
]
ViewSizeOption = Annotated[
    str | None,
    typer.Option("--size", metavar="WxH", help="Size of the views, in pixels. [64x48]", show_default=False),
]
SplitErrorOption = Annotated[
    bool, typer.Option("--split-error", help="Split the remaining error by cause; draws a few more frames.")
]
SeedOption = Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Random seed.")]


def parse_numbers(text: str, flag: str, counts: tuple[int, ...]) -> list[float]:
    """Parse finite numbers separated by commas.

    Args:
        text: the value of the flag.
        flag: named in errors.
        counts: how many numbers are allowed.

    Raises:
        InputError: there are more or fewer numbers, or one is not finite or too large.
    """
    from vpltune.renderer.scene.files.plain_numbers import plain_number

    need = " or ".join(str(count) for count in counts)
    try:
        numbers = [plain_number(item) for item in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts:
        raise InputError(f"{flag}: must be {need} finite numbers separated by commas, got {text!r:.60}")
    return numbers


def parse_size(text: str) -> tuple[int, int]:
    """Parse width and height in pixels, such as "640x480".

    Raises:
        InputError: the text has another form, or a side is not in [1, `LARGEST_SIDE`].
    """
    match = re.fullmatch(r"([0-9]{1,6})[xX×]([0-9]{1,6})", text)
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if not all(1 <= side <= LARGEST_SIDE for side in size):
        raise InputError(f"--size: must be WxH with sides from 1 to {LARGEST_SIDE}, got {text!r:.60}")
    return size


def checked_scale(scale: float) -> float:
    """Return `scale` if single precision can represent scenes scaled by it.

    Raises:
        InputError: it is not a finite number in [1e-6, 1e6].
    """
    if not (math.isfinite(scale) and 1e-6 <= scale <= 1e6):
        raise InputError(f"--scale: must be a number from 1e-6 to 1e6, got {scale}")
    return scale
