"""docs/test_vectors.json as tests read it."""

import json
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from built_scenes import quad, scene_of

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.scene.light_faces import light_records
from vpltune.renderer.scene.scene import Light, Scene

REPOSITORY = Path(__file__).resolve().parents[2]
VECTORS: dict[str, Any] = json.loads((REPOSITORY / "docs" / "test_vectors.json").read_text(encoding="utf-8"))
BOUNDS = np.array(VECTORS["faces"][0]["bounds"], np.float64)
"""Of the boxes."""


def boxes() -> Scene:
    """The scene of the file; normals point out of the boxes."""
    meshes = []
    for index, box in enumerate(VECTORS["boxes"]):
        low, high = np.array(box["low"]), np.array(box["high"])
        edges = np.diag(high - low)
        for axis in range(3):
            u, v = edges[(axis + 1) % 3], edges[(axis + 2) % 3]
            meshes.append(quad(low, v, u, index))
            meshes.append(quad(low + edges[axis], u, v, index))
    return scene_of(meshes, [box["reflectance"] for box in VECTORS["boxes"]])


def light_of(document: dict[str, Any]) -> Light:
    """A light from its document, which is as in views.json."""
    names = {"position": "position_world", "direction": "direction_world"}
    placed = {name: np.array(document[key]) for key, name in names.items() if key in document}
    cones = {key: document[key] for key in ("inner_cone", "outer_cone") if key in document}
    return Light(document["type"], np.array(document["intensity"]), **placed, **cones)


def bind_light(context: moderngl.Context, light: Light) -> None:
    """Make `light` the only one, with its faces for the scene of boxes."""
    records = light_records((light,), BOUNDS)
    for values, binding in (
        (records.lights, buffer_bindings.LIGHTS),
        (records.faces, buffer_bindings.RSM_FACES),
    ):
        context.buffer(np.ascontiguousarray(values).tobytes()).bind_to_storage_buffer(binding)


def buffer_of(context: moderngl.Context, values: np.ndarray, binding: int) -> moderngl.Buffer:
    """A buffer that holds `values`, bound; it lives as long as someone holds it."""
    buffer = context.buffer(np.ascontiguousarray(values).tobytes())
    buffer.bind_to_storage_buffer(binding)
    return buffer


def vpl_rows(vpls: dict[str, Any]) -> np.ndarray:
    """VPLs as shaders have them: [vpls, 12] of float32."""
    rows = np.zeros((len(vpls["footprint"]), 12), np.float32)
    rows[:, 0:3], rows[:, 3] = vpls["position"], vpls["footprint"]
    rows[:, 4:7], rows[:, 7] = vpls["normal"], np.pi * np.array(vpls["footprint"]) ** 2
    rows[:, 8:11] = vpls["flux"]
    return rows


def assert_same_vpls(rows: np.ndarray, expected: dict[str, Any], rtol: float) -> None:
    """VPLs as shaders have them against those of the file; lengths to `rtol` of the scene's few units."""
    np.testing.assert_allclose(rows[:, 0:3], expected["position"], atol=3.0 * rtol)
    np.testing.assert_allclose(rows[:, 4:7], expected["normal"], atol=1e-4)
    np.testing.assert_allclose(rows[:, 3], expected["footprint"], rtol=rtol)
    np.testing.assert_allclose(rows[:, 8:11], expected["flux"], rtol=rtol)
