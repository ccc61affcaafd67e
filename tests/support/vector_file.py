"""docs/test_vectors.json as tests read it."""

import json
import math
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from built_scenes import quad, scene_of

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.gpu.camera_uniforms import camera_uniforms
from vpltune.renderer.scene.light_faces import LightRecords, light_records
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.sun_faces import SunGrid

REPOSITORY = Path(__file__).resolve().parents[2]
VECTORS: dict[str, Any] = json.loads((REPOSITORY / "docs" / "test_vectors.json").read_text(encoding="utf-8"))
BOUNDS = np.array(VECTORS["faces"][0]["bounds"], np.float64)
"""Bounds of the scene of boxes."""
DIAGONAL = float(np.linalg.norm(BOUNDS[1] - BOUNDS[0]))
PI = "const float PI = 3.14159265358979;"


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
    return scene_of(meshes, [tuple(box["reflectance"]) for box in VECTORS["boxes"]])


def light_of(document: dict[str, Any]) -> Light:
    """A light from its document, which is as in views.json."""
    names = {"position": "position_world", "direction": "direction_world"}
    placed = {name: np.array(document[key]) for key, name in names.items() if key in document}
    cones = {key: document[key] for key in ("inner_cone", "outer_cone") if key in document}
    reach = document.get("range", math.inf)
    return Light(document["type"], np.array(document["intensity"]), **placed, **cones, range=reach)


def records_of(light: Light) -> LightRecords:
    """One light and its faces, for the scene of boxes."""
    return light_records((light,), BOUNDS, SunGrid(1024, (0.0, 0.0, 0.0)))


def light_buffers(context: moderngl.Context, light: Light) -> dict[str, moderngl.Buffer]:
    """The light and its faces as shaders read them."""
    records = records_of(light)
    return {"lights": buffer_of(context, records.lights), "rsm_faces": buffer_of(context, records.faces)}


def inputs_of(
    light: Light, parameters: ArtistParameters, table_rotation: tuple[float, float] = (0.0, 0.0)
) -> FrameInputs:
    """What passes are given that look at no camera."""
    camera = camera_uniforms(Camera(np.eye(4), 1.0), (8, 8), BOUNDS)
    return FrameInputs(camera, records_of(light), parameters, DIAGONAL, table_rotation)


def buffer_of(context: moderngl.Context, values: np.ndarray) -> moderngl.Buffer:
    """A buffer that holds `values`."""
    return context.buffer(np.ascontiguousarray(values).tobytes())


def vpl_rows(vpls: dict[str, Any]) -> np.ndarray:
    """VPLs as shaders have them: [vpls, 12] of float32."""
    rows = np.zeros((len(vpls["footprint"]), 12), np.float32)
    rows[:, 0:3], rows[:, 3] = vpls["position"], vpls["footprint"]
    rows[:, 4:7], rows[:, 7] = vpls["normal"], np.pi * np.array(vpls["footprint"]) ** 2
    rows[:, 8:11] = vpls["flux"]
    return rows


def assert_same_vpls(content: bytes, expected: dict[str, Any], rtol: float) -> None:
    """A buffer of VPLs against those of the file; lengths to `rtol` of the scene's few units."""
    rows = np.frombuffer(content, np.float32).reshape(-1, 12)
    np.testing.assert_allclose(rows[:, 0:3], expected["position"], atol=3.0 * rtol)
    np.testing.assert_allclose(rows[:, 4:7], expected["normal"], atol=1e-4)
    np.testing.assert_allclose(rows[:, 3], expected["footprint"], rtol=rtol)
    np.testing.assert_allclose(rows[:, 8:11], expected["flux"], rtol=rtol)
