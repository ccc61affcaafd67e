"""Arguments and options that several commands share, and how their text is read.

Nothing here imports more than typer, so that `vpltune --help` comes up at once.
"""

import math
import re
from pathlib import Path
from typing import Annotated, Literal

import typer

from vpltune.renderer.errors import InputError

LARGEST_SIDE = 16384
"""Pixels; also the rule of `views.json`."""

LARGEST_VIEW_COUNT = 64
"""The largest number of views that `--views` takes."""
VIEW_COUNT = 4
"""How many views a scene is fitted to by default. With validation and held-out views, that makes ten light
positions."""

SCENE_SECONDS = 900.0
"""The time limit of a batch for one attempt at a scene: many times what the slowest known scene takes."""

Layer = Literal["final", "direct", "indirect", "irradiance", "albedo", "normal", "depth"]
Motion = Literal["auto", "none", "light", "camera", "both"]
Bounces = Literal["1", "all"]

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
    int | None,
    typer.Option(
        metavar="1|2|4|8",
        help="Blocks of NxN pixels share the VPLs out: faster above 1; overrides the config.",
        show_default=False,
    ),
]
MapSizeOption = Annotated[
    int | None,
    typer.Option(
        metavar="TEXELS",
        help="Side of a VPL's visibility map, from 4 to 64; overrides the config.",
        show_default=False,
    ),
]
MapRefinementOption = Annotated[
    int | None,
    typer.Option(
        metavar="1|2|4|8",
        help="How many times finer maps are at silhouettes; overrides the config.",
        show_default=False,
    ),
]
RsmResolutionOption = Annotated[
    int | None,
    typer.Option(
        metavar="TEXELS",
        help="Side of a face of a light's map, which VPLs and shadows come from, from 64 to 8192; overrides "
        "the config.",
        show_default=False,
    ),
]
StartOption = Annotated[
    str,
    typer.Option(
        "--config", metavar="START.json", help="Start from this config: a file, `default` or `auto`."
    ),
]
ViewCountOption = Annotated[
    int,
    typer.Option(
        "--views",
        min=1,
        max=LARGEST_VIEW_COUNT,
        help="How many views of a scene to fit; as many validate the fit, half as many are held out.",
    ),
]
BouncesOption = Annotated[
    Bounces, typer.Option(help="What the reference is: one bounce, or full global illumination.")
]
ViewSizeOption = Annotated[
    str | None,
    typer.Option("--size", metavar="WxH", help="Size of the views, in pixels. [64x48]", show_default=False),
]
SplitErrorOption = Annotated[
    bool, typer.Option("--split-error", help="Split the error that is left by cause; draws some more frames.")
]
SeedOption = Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Seed of everything random.")]


def parse_numbers(text: str, flag: str, counts: tuple[int, ...]) -> list[float]:
    """Finite numbers parted by commas.

    Raises:
        InputError: another count of them than `counts` allows, or one is not a finite number.
    """
    need = " or ".join(str(count) for count in counts)
    try:
        numbers = [float(item) for item in text.split(",")]
    except ValueError:
        numbers = []
    # 1e30: squares of it still fit double precision, and views.json has the same bound.
    if len(numbers) not in counts or not all(abs(number) <= 1e30 for number in numbers):
        raise InputError(f"{flag}: must be {need} finite numbers parted by commas, got {text!r:.60}")
    return numbers


def parse_size(text: str) -> tuple[int, int]:
    """Width and height in pixels from "640x480".

    Raises:
        InputError: the text is of another form, or a side is not in [1, LARGEST_SIDE].
    """
    match = re.fullmatch(r"([0-9]{1,6})[xX×]([0-9]{1,6})", text)
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if not all(1 <= side <= LARGEST_SIDE for side in size):
        raise InputError(f"--size: must be WxH with sides from 1 to {LARGEST_SIDE}, got {text!r:.60}")
    return size


def checked_scale(scale: float) -> float:
    """`scale`, if it is a factor that single precision survives.

    Raises:
        InputError: not a finite number in [1e-6, 1e6].
    """
    if not (math.isfinite(scale) and 1e-6 <= scale <= 1e6):
        raise InputError(f"--scale: must be a number from 1e-6 to 1e6, got {scale}")
    return scale
