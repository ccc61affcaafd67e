"""Write docs/parameters.md anew from the parameter table and the quality part of a config.

python scripts/make_parameter_page.py
"""

from pathlib import Path
from typing import Any

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ParameterSpec
from vpltune.renderer.config.light_settings import (
    MOST_BOUNCES,
    MOST_SKY_LIGHTS,
    ONE_BOUNCE,
    LightSettings,
    light_schema,
)
from vpltune.renderer.config.quality import quality_schema
from vpltune.renderer.files.atomic_file import write_text_whole

PAGE = Path(__file__).resolve().parents[1] / "docs" / "parameters.md"

HEAD = """# Parameters

All keys of a config's `parameters`, `quality` and `light`, as `renderer/config/artist_parameters.py`,
`quality.py` and `light_settings.py` define them. `python scripts/make_parameter_page.py` makes this page.

No parameter has a world unit. Lengths are in VPL footprints ℓ, in the scene length L, or in the distance
between a VPL and a receiver. One config serves a scene at any scale.

A value outside its range is an error. The bounds themselves are allowed.
"""

PARAMETERS_HEAD = """
## `parameters`

Every key must be present. `vpltune fit` fits those marked *fitted* by gradient. It also chooses
`density_importance`; `density_exponent` with few VPLs; and `vpl_count` where a frame-time budget is given.

"""

QUALITY_HEAD = """
## `quality`

Settings that trade image quality for frame time. A key that is left out has its default.

"""

LIGHT_HEAD = """
## `light`

Which of a scene's light is drawn. Files that lack it are of one bounce, as all were before the key.

| key | default | in a file without it | allowed | meaning |
|---|---|---|---|---|
"""

QUALITY_MEANINGS = {
    "interleave": "side of a pixel block that shares the VPLs out; 1 gathers every VPL at every pixel, "
    "auto follows the frame's size",
    "map_size": "texels along the side of a VPL's visibility map",
    "map_refinement": "rays along the side of a map texel that a silhouette crosses",
    "rsm_resolution": "texels along the side of an RSM face",
    "lloyd_iterations": "",
    "adaptation_frames": "time constant in frames at which a clip follows the prior of an `auto` config",
    "budget": "the frame-time budget that was met: `milliseconds`, `frame_size`, `machine`",
}
NO_DEFAULT = {"rsm_resolution": "1024; 512 with more than two RSM faces", "budget": "none"}


def page() -> str:
    """The page's text."""
    own = [spec for spec in ARTIST_PARAMETERS if spec.part == "parameters"]
    (iterations,) = (spec for spec in ARTIST_PARAMETERS if spec.part == "quality")
    rows = [_parameter_row(spec) for spec in own]
    heading = "| key | symbol | default | range | scale | unit | fitted | meaning |\n" + "|---" * 8 + "|\n"
    quality = quality_schema({"type": "integer", "minimum": iterations.low, "maximum": iterations.high,
                              "default": iterations.default})["properties"]  # fmt: skip
    assert set(quality) == set(QUALITY_MEANINGS), "a key of `quality` has no meaning here"
    quality_rows = [
        _quality_row(name, member, QUALITY_MEANINGS[name] or iterations.meaning)
        for name, member in quality.items()
    ]
    quality_heading = "| key | default | allowed | meaning |\n" + "|---" * 4 + "|\n"
    return "".join((HEAD, PARAMETERS_HEAD, heading, *rows, QUALITY_HEAD, quality_heading, *quality_rows,
                    LIGHT_HEAD, *_light_rows()))  # fmt: skip


def _light_rows() -> list[str]:
    default, absent = LightSettings().as_dict(), ONE_BOUNCE.as_dict()
    allowed = {"bounces": f"1 … {MOST_BOUNCES}, all", "sky_lights": f"1 … {MOST_SKY_LIGHTS}"}
    return [
        _row((f"`{name}`", f"{default[name]}", f"{absent[name]}", allowed[name], member["description"]))
        for name, member in light_schema()["properties"].items()
    ]


def _parameter_row(spec: ParameterSpec) -> str:
    cells = (
        f"`{spec.name}`",
        spec.symbol,
        f"{spec.default:g}",
        f"{spec.low:g} … {spec.high:g}",
        "whole numbers, log" if spec.whole_number and spec.scale == "log" else spec.scale,
        spec.unit,
        "fitted" if spec.fitted else "",
        spec.meaning,
    )
    return _row(cells)


def _quality_row(name: str, member: dict[str, Any], meaning: str) -> str:
    default = NO_DEFAULT.get(name) or f"{member['default']}".removesuffix(".0")
    if "enum" in member:
        allowed = ", ".join(str(value) for value in member["enum"])
    elif "minimum" in member:
        allowed = f"{member['minimum']:g} … {member['maximum']:g}"
        allowed += ", whole numbers" if member["type"] == "integer" else ""
    else:
        allowed = "object"
    return _row((f"`{name}`", default, allowed, meaning))


def _row(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cells) + " |\n"


if __name__ == "__main__":
    write_text_whole(PAGE, page())
