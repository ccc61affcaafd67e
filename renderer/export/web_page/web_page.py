"""One HTML file with a scene, its config and shaders inside: it draws the scene live and fetches nothing."""

import base64
import html
import json
import zlib
from importlib.resources import files
from typing import Any

import numpy as np

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, LARGEST_DISC_COUNT
from vpltune.renderer.errors import InputError
from vpltune.renderer.export.scene_bundle import SceneBundle
from vpltune.renderer.frame import vpl_disc_bounds
from vpltune.renderer.frame.passes import vpl_importance
from vpltune.renderer.frame.passes.tone_mapping import EXPOSURE_KEY
from vpltune.renderer.frame.visibility_map_layout import VisibilityMapLayout
from vpltune.renderer.gpu.bounding_volumes import COUNT_BITS, LEAF_ITEMS, NODE_DTYPE, build_bounding_volumes
from vpltune.renderer.gpu.shader_library import Define, ShaderSource

VPL_COLUMNS = 64
"""VPLs in a row of the textures that hold them."""
DATA_COLUMNS = 2048
"""Texels in a row of the textures that hold trees, triangles and visibility maps; any WebGL 2 has so many."""
_TREE_DEPTH = 60
"""Levels of the page's tree of boxes, which is the size of a ray's stack. A choice."""

NOTE = "Indirect light from virtual point lights, drawn live in this page"

_SCRIPTS = ("page.js", "frame.js", "surfaces.js", "camera.js", "values.js", "controls.js")
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
    "web/vpl_importance_cells.frag",
    "web/vpl_importance_receivers.frag",
    "web/vpl_importance.frag",
    "web/vpl_importance_mean.frag",
)
_DISC_SHADERS = ("web/clustered_discs_owners.frag", "web/clustered_discs.frag", "web/vpl_gather_discs.frag")
_MAP_SHADERS = ("web/vpl_visibility_maps.frag", "web/vpl_visibility_edges.frag")
_DETAIL_SHADERS = ("web/vpl_visibility_details.frag",)
_HEADER = """#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
#define precise
"""


def web_page(bundle: SceneBundle) -> str:
    """The page, which draws in any browser with WebGL 2 and float targets; it says what is left out.

    Raises:
        InputError: the bundle's view has no light.
    """
    if not bundle.document["lights"]:
        raise InputError("web page: the view must have a light; a page draws lamps alone")
    # One button draws the defaults, which are placed by importance even where the config is not.
    faces = bundle.document["rsm"]["faces"]
    # All orthographic faces of a light lie in its first.
    outer = {face["light"] if face["orthographic"] else -1 - i for i, face in enumerate(faces)}
    importance = bundle.document["vpl_importance"] | {"cells": vpl_importance.importance_cells(len(outer))}
    drawn = bundle.document | {"vpl_importance": importance}
    defines = _defines(drawn)
    binary = bundle.binary
    arrays = {name: at for name, at in bundle.document["arrays"].items() if name not in ("lights", "faces")}
    # The camera, too, moves by this tree.
    defines["RAY_ROOT"], trees = _ray_tree(bundle)
    for name, values in trees.items():
        content = values.tobytes()
        arrays[name] = {"offset": len(binary), "bytes": len(content)}
        binary += content
    document = drawn | {
        "vpl_columns": VPL_COLUMNS,
        "data_columns": DATA_COLUMNS,
        "note": ". ".join([NOTE, *bundle.left_out]) + ".",
        "table": _table(),
        "arrays": arrays,
        "ray_tree": {"root": defines["RAY_ROOT"], "count_bits": COUNT_BITS},
    }
    parts = {
        "TITLE": html.escape(f"{bundle.document['scene']} – VPLtune"),
        "STYLE": _text("page.css"),
        "DOCUMENT": _json(document),
        "BINARY": base64.b64encode(zlib.compress(binary, 9)).decode("ascii"),
        "SHADERS": _json(_shaders(drawn, defines)),
        "SCRIPT": "".join(_text(name) for name in _SCRIPTS),
    }
    page = _text("page.html")
    # Piece by piece from the template's own places: what is put in is never looked into.
    pieces = []
    for name, text in parts.items():
        before, page = page.split(f"@{name}@")
        pieces += [before, text]
    return "".join([*pieces, page])


def _defines(document: dict[str, Any]) -> dict[str, Define]:
    maps = document["visibility_maps"]
    return {
        "LIGHT_COUNT": len(document["lights"]),
        "RSM_FACE_COUNT": len(document["rsm"]["faces"]),
        "RSM_RESOLUTION": document["rsm"]["resolution"],
        "RSM_FILTERING": document["rsm"]["filtering"],
        "VPL_COLUMNS": VPL_COLUMNS,
        "DATA_COLUMNS": DATA_COLUMNS,
        **VisibilityMapLayout(maps["map_size"], maps["map_refinement"]).defines,
        "RAY_COUNT_BITS": COUNT_BITS,
        "RAY_STACK_SIZE": _TREE_DEPTH,
        "EXPOSURE_KEY": EXPOSURE_KEY,
        "NORMAL_REACH": document["clustered_discs"]["normal_reach"],
        "OFF_PLANE_FACTOR": document["clustered_discs"]["off_plane_factor"],
        "SAMPLE_REACH": document["clustered_discs"]["sample_reach"],
        **vpl_disc_bounds.DEFINES,
        **vpl_importance.DEFINES,
        "IMPORTANCE_CELLS": document["vpl_importance"]["cells"],
    }


def _ray_tree(bundle: SceneBundle) -> tuple[int, dict[str, np.ndarray]]:
    """The root of a tree of boxes over all triangles, and tree and triangles in whole rows of texels."""

    def array(name: str) -> np.ndarray:
        at = bundle.document["arrays"][name]
        count = at["bytes"] // np.dtype(at["type"]).itemsize
        return np.frombuffer(bundle.binary, at["type"], count, at["offset"]).reshape(at["shape"])

    corners = array("positions")[array("triangles")]
    tree = build_bounding_volumes(corners.min(axis=1), corners.max(axis=1), LEAF_ITEMS, _TREE_DEPTH)
    assert NODE_DTYPE.itemsize == 32, "a node is two texels of four 32-bit numbers"
    padded = np.zeros((*corners.shape[:2], 4), np.float32)
    padded[..., :3] = corners[tree.order]
    # An empty tree, of one leaf, still is a texture.
    nodes = np.frombuffer(tree.nodes.tobytes() or bytes(32), np.uint32)
    return tree.root, {"ray_nodes": _whole_rows(nodes), "ray_triangles": _whole_rows(padded.ravel())}


def _whole_rows(values: np.ndarray) -> np.ndarray:
    rows = -(-len(values) // (4 * DATA_COLUMNS))
    return np.concatenate([values, np.zeros(rows * 4 * DATA_COLUMNS - len(values), values.dtype)])


def _shaders(document: dict[str, Any], defines: dict[str, Define]) -> dict[str, str]:
    names = _SHADERS
    # The defaults have discs too.
    if document["config"]["parameters"]["vpl_count"] <= LARGEST_DISC_COUNT:
        names += _DISC_SHADERS
    if defines["VISIBILITY_MAP_SIZE"]:
        names += _MAP_SHADERS
        if document["visibility_maps"]["map_refinement"] > 1:
            names += _DETAIL_SHADERS
    return {name: _web_glsl(name, defines) for name in names}


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
    return files("vpltune.renderer.export.web_page").joinpath(name).read_text(encoding="utf-8")
