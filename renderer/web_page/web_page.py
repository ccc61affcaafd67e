"""One HTML file with a scene, its config and shaders inside: it draws the scene live and fetches nothing."""

import base64
import html
import json
import zlib
from importlib.resources import files
from typing import Any

from renderer.artist_parameters import ARTIST_PARAMETERS
from renderer.errors import InputError
from renderer.passes.tone_mapping import EXPOSURE_KEY
from renderer.scene_bundle import SceneBundle
from renderer.shader_library import Define, ShaderSource

VPL_COLUMNS = 64
"""VPLs in a row of the textures that hold them."""

NOTE = "One bounce of indirect light from virtual point lights, drawn live in this page"

_SHADERS = (
    "web/fullscreen.vert",
    "web/scene.vert",
    "web/geometry.frag",
    "web/reflective_shadow_map.frag",
    "web/vpl_weights.frag",
    "web/running_sum.frag",
    "web/moment_sums.frag",
    "web/virtual_point_lights.frag",
    "web/vpl_gather.frag",
    "web/direct_light.frag",
    "web/material_resolve.frag",
    "web/tone_mapping.frag",
)
_HEADER = "#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n"


def web_page(bundle: SceneBundle, left_out: tuple[str, ...] = ()) -> str:
    """The page, which draws in any browser with WebGL 2 and float targets; it says what is `left_out`.

    Raises:
        InputError: the bundle's view has no light.
    """
    if not bundle.document["lights"]:
        raise InputError("web page: the view must have a light")
    document = bundle.document | {
        "vpl_columns": VPL_COLUMNS,
        "note": ". ".join([NOTE, *left_out]) + ".",
        "table": _table(),
        # What only other readers need.
        "arrays": {
            name: at for name, at in bundle.document["arrays"].items() if name not in ("lights", "faces")
        },
    }
    parts = {
        "TITLE": html.escape(f"{bundle.document['scene']} – VPLtune"),
        "STYLE": _text("page.css"),
        "DOCUMENT": _json(document),
        "BINARY": base64.b64encode(zlib.compress(bundle.binary, 9)).decode("ascii"),
        "SHADERS": _json(_shaders(bundle.document)),
        "SCRIPT": _text("page.js") + _text("controls.js"),
    }
    page = _text("page.html")
    # Piece by piece from the template's own places: what is put in is never looked into.
    pieces = []
    for name, text in parts.items():
        before, page = page.split(f"@{name}@")
        pieces += [before, text]
    return "".join([*pieces, page])


def _shaders(document: dict[str, Any]) -> dict[str, str]:
    defines: dict[str, Define] = {
        "LIGHT_COUNT": len(document["lights"]),
        "RSM_FACE_COUNT": len(document["rsm"]["faces"]),
        "RSM_RESOLUTION": document["rsm"]["resolution"],
        "RSM_FILTERING": document["rsm"]["filtering"],
        "VPL_COLUMNS": VPL_COLUMNS,
        "EXPOSURE_KEY": EXPOSURE_KEY,
    }
    return {name: _web_glsl(name, defines) for name in _SHADERS}


def _web_glsl(name: str, defines: dict[str, Define]) -> str:
    """A shader with its includes, as GLSL ES 3.00."""
    first, _, body = ShaderSource(name, defines).text.partition("\n")
    assert first.startswith("#version")
    return _HEADER + "\n".join(line for line in body.splitlines() if not line.startswith("#line"))


def _table() -> list[dict[str, Any]]:
    keys = ("name", "symbol", "default", "low", "high", "scale", "unit", "meaning")
    return [{key: getattr(spec, key) for key in keys} for spec in ARTIST_PARAMETERS]


def _json(value: Any) -> str:
    """JSON that no HTML parser takes for the end of its element."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _text(name: str) -> str:
    return files("renderer.web_page").joinpath(name).read_text(encoding="utf-8")
