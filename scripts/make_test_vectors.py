"""Write docs/test_vectors.json: inputs and results of every step in docs/runtime_formulas.md.

    python scripts/make_test_vectors.py

The results are of `examples/formulas`, in float64. Tests hold the runtime's shaders and the tuner's surrogate
to them (tests/renderer/export/test_test_vectors.py).
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
from vector_json import json_text, plain

from examples.formulas import boxes as box_scene
from examples.formulas import display, visibility_maps
from examples.formulas.clustered_discs import lloyd_iteration
from examples.formulas.point_table import r2_points, rotated
from examples.formulas.punctual_lights import cone_falloff, facing_irradiance, light_faces, towards_light
from examples.formulas.reflective_shadow_map import (
    RsmTexels,
    rsm_texels,
    scene_length,
    stored_depth,
    texel_centers,
    texel_rays,
)
from examples.formulas.vectors import dot, unit
from examples.formulas.virtual_point_lights import Vpls, draw_vpls, sampling_weights
from examples.formulas.vpl_gather import gather
from examples.formulas.vpl_importance import importance_cells, importance_factor

FILE = Path(__file__).resolve().parents[1] / "docs" / "test_vectors.json"
"""Significant digits of the file's numbers. A choice: more than a float32 holds."""

BOXES = [
    {"name": "floor", "low": [-2.0, -0.2, -2.0], "high": [2.0, 0.0, 2.0], "reflectance": [0.8, 0.7, 0.6]},
    {"name": "wall", "low": [-2.0, 0.0, -2.2], "high": [2.0, 2.5, -2.0], "reflectance": [0.3, 0.6, 0.8]},
    {"name": "block", "low": [-0.9, 0.0, -1.1], "high": [-0.2, 0.8, -0.4], "reflectance": [0.7, 0.2, 0.2]},
]
SPOT = {
    "type": "spot",
    "position": [1.1, 2.3, 0.9],
    "direction": unit(np.array([-1.3, -2.2, -1.8])).tolist(),
    "intensity": [12.0, 10.0, 8.0],
    "inner_cone": 0.35,
    "outer_cone": 0.75,
}
WIDE_SPOT = {**SPOT, "inner_cone": 0.2, "outer_cone": 1.3}
POINT = {"type": "point", "position": [0.4, 1.7, 0.2], "intensity": [3.0, 4.0, 5.0]}
POINT_WITH_RANGE = {**POINT, "range": 2.2}
SUN = {
    "type": "directional",
    "direction": unit(np.array([0.48, -0.6, -0.64])).tolist(),
    "intensity": [3.0, 2.5, 2.0],
}
RSM_RESOLUTION = 8
"""Texels along the side of an RSM face. A choice: small, so that the file is."""
LENGTH = 0.75
"""L of the gather and the maps. Not that of the RSM: every step can be tested alone."""

# position, normal, footprint, flux
VPLS = [
    ([0.5, 0.0, -0.3], [0.0, 1.0, 0.0], 0.3, [1.5, 1.2, 0.9]),
    ([-0.4, 1.2, -2.0], [0.0, 0.0, 1.0], 0.25, [0.3, 0.7, 0.9]),
    ([-0.5, 0.8, -0.7], [0.0, 1.0, 0.0], 0.12, [0.8, 0.2, 0.1]),
    ([-0.2, 0.4, -0.8], [1.0, 0.0, 0.0], 0.05, [0.4, 0.1, 0.1]),
    ([1.2, 0.0, -1.5], [0.0, 1.0, 0.0], 0.6, [0.9, 0.8, 0.6]),
    ([0.1, 0.9, -0.1], [0.48, -0.6, 0.64], 0.2, [0.5, 0.5, 0.5]),
]
RECEIVERS = [
    ([1.0, 0.0, 0.5], [0.0, 1.0, 0.0], "on the floor"),
    ([0.8, 0.9, -2.0], [0.0, 0.0, 1.0], "on the wall"),
    ([-0.2, 0.3, -0.6], [1.0, 0.0, 0.0], "on the block"),
    ([-0.4, 0.0, -1.95], [0.0, 1.0, 0.0], "in the corner of floor and wall"),
    ([0.52, 0.2, -0.28], [0.0, -1.0, 0.0], "close over a VPL, facing it"),
    ([1.5, 0.02, 0.3], [-0.6, -0.8, 0.0], "a little over a VPL's plane"),
    ([0.7, 0.0005, -0.3], [-1.0, 0.0, 0.0], "within the height in which discs fade"),
    ([0.5, -0.1, -0.3], [0.0, 1.0, 0.0], "behind a VPL's plane"),
    ([0.0, 1.0, -2.2], [0.0, 0.0, -1.0], "on the back of the wall: the horizon hides all but large discs"),
]
ALPHAS, KAPPAS = (0.25, 0.5, 1.0, 4.0), (0.0, 3.0)
"""Values of α and κ that the gather is computed with. A choice."""


def test_vectors() -> dict[str, Any]:
    """The whole file, numbers as they were computed."""
    face = spot_face()
    rsm = _rsm_inputs(face)
    texels = rsm_texels(SPOT, face, *rsm)
    return {
        "format": "vpltune-test-vectors",
        "version": 1,
        "boxes": BOXES,
        "point_table": _point_table(),
        "lights": [_light(light) for light in (SPOT, POINT, POINT_WITH_RANGE, SUN)],
        "faces": [_faces(light) for light in (SPOT, WIDE_SPOT, POINT, SUN)],
        "rsm": _rsm(face, rsm, texels),
        "placement": [_placement(face, texels, *case) for case in PLACEMENTS],
        "importance": _importance(face, texels),
        "clusters": _clusters(face, texels),
        "gather": _gather(),
        "visibility": _visibility(),
        "display": _display(),
    }


def spot_face() -> dict[str, Any]:
    """The one face of the spot, with its resolution."""
    bounds = box_scene.bounds(BOXES)
    return {**light_faces(SPOT, bounds, bounds, RSM_RESOLUTION)[0], "resolution": RSM_RESOLUTION}


def vpls_of(rows: list) -> Vpls:
    """VPLs from rows of position, normal, footprint, flux."""
    return Vpls(*(np.array([row[i] for row in rows], np.float64) for i in range(4)))


def receivers() -> tuple[np.ndarray, np.ndarray]:
    """Positions and normals."""
    return np.array([row[0] for row in RECEIVERS]), np.array([row[1] for row in RECEIVERS])


ROTATION = (0.3, 0.7)
"""Rotation of the point table. A choice: not the identity."""


def _point_table() -> dict[str, Any]:
    points = r2_points(16)
    return {"points": points, "rotation": ROTATION, "rotated": rotated(points, ROTATION)}


def _light(light: dict) -> dict[str, Any]:
    position = np.array([[0.2, 0.0, -0.5], [-0.5, 0.8, -0.7], [0.3, 1.0, -2.0], [1.9, 0.0, -1.9]])
    return {"light": light, "position": position, "irradiance_facing": facing_irradiance(light, position)}


def _faces(light: dict) -> dict[str, Any]:
    bounds = box_scene.bounds(BOXES)
    return {
        "light": light,
        "bounds": bounds,
        "resolution": 1024,
        "faces": light_faces(light, bounds, bounds, 1024),
    }


def _rsm_inputs(face: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth, normal and reflectance of the texels, as the RSM pass stores them."""
    size = face["resolution"]
    depth, normal, reflectance = np.zeros((size, size)), np.zeros((size, size, 3)), np.zeros((size, size, 3))
    origins, rays = texel_rays(face, texel_centers(size))
    back = face["light_to_world"][:3, 2]
    for at in np.ndindex(size, size):
        distance, box, met_normal = box_scene.nearest_hit(BOXES, origins[at], rays[at])
        if box < 0:
            continue
        met = origins[at] + distance * rays[at]
        depth[at] = stored_depth(face, dot(origins[at] - met, back))
        normal[at] = met_normal
        cone = cone_falloff(SPOT, -towards_light(SPOT, met[None]))[0]
        reflectance[at] = np.array(BOXES[box]["reflectance"]) * cone
    # What half floats hold.
    return depth, normal, reflectance.astype(np.float16).astype(np.float64)


def _rsm(face: dict, inputs: tuple, texels: RsmTexels) -> dict[str, Any]:
    depth, normal, reflectance = inputs
    return {
        "light": SPOT,
        "face": face,
        "depth": depth,
        "normal": normal,
        "reflectance": reflectance,
        "flux": texels.flux,
        "area": texels.area,
        "position": texels.position,
        "total_flux": float(texels.mean_flux.sum()),
        "lit_texels": int((texels.mean_flux > 0.0).sum()),
        "scene_length": scene_length([texels]),
    }


# count, exponent, filtering, rotation
PLACEMENTS = [(16, 1.0, 5, (0.0, 0.0)), (16, 0.5, 1, (0.0, 0.0)), (16, 0.5, 5, ROTATION)]


def _placement(
    face: dict, texels: RsmTexels, count: int, exponent: float, filtering: int, rotation: tuple[float, float]
) -> dict[str, Any]:
    points = rotated(r2_points(count), rotation)
    weights = sampling_weights(texels, exponent)
    return {
        "vpl_count": count,
        "density_exponent": exponent,
        "filtering": filtering,
        "rotation": rotation,
        "vpls": _vpls_document(draw_vpls(texels, face, weights, points, filtering)),
    }


def _vpls_document(vpls: Vpls) -> dict[str, Any]:
    return {
        "position": vpls.position,
        "normal": vpls.normal,
        "footprint": vpls.footprint,
        "flux": vpls.flux,
    }


def _importance(face: dict, texels: RsmTexels) -> dict[str, Any]:
    position, normal = receivers()
    cells = importance_cells(texels, 2)
    estimate, factor = importance_factor(position, normal, cells, 0.7)
    at = np.arange(RSM_RESOLUTION) * 2 // RSM_RESOLUTION
    weights = sampling_weights(texels, 1.0, factor[np.ix_(at, at)])
    return {
        "cells_of_face": 2,
        "density_importance": 0.7,
        "position": position,
        "normal": normal,
        "cells": cells,
        "estimate": estimate,
        "factor": factor,
        "vpls": _vpls_document(draw_vpls(texels, face, weights, r2_points(16))),
    }


def _clusters(face: dict, texels: RsmTexels) -> dict[str, Any]:
    samples = draw_vpls(texels, face, sampling_weights(texels, 1.0), r2_points(64))
    vpls = Vpls(samples.position[:4], samples.normal[:4], samples.footprint[:4], samples.flux[:4])
    length = scene_length([texels])
    steps = []
    for _ in range(3):
        vpls = lloyd_iteration(vpls, samples, length)
        steps.append(_vpls_document(vpls))
    return {"scene_length": length, "vpl_count": 4, "samples": _vpls_document(samples), "steps": steps}


def _gather() -> dict[str, Any]:
    position, normal = receivers()
    vpls = vpls_of(VPLS)
    cases = []
    for discs in (False, True):
        for alpha in ALPHAS:
            for kappa in KAPPAS:
                per_watt = gather(position, normal, vpls, LENGTH, discs=discs, alpha=alpha, kappa=kappa)
                cases.append(
                    {
                        "form": "disc" if discs else "point",
                        "intensity": 1.0,
                        "falloff_footprint": alpha,
                        "extinction_coefficient": kappa,
                        "irradiance_per_watt": per_watt,
                        "irradiance": per_watt @ vpls.flux,
                    }
                )
    return {
        "scene_length": LENGTH,
        "vpls": _vpls_document(vpls),
        "receivers": {"position": position, "normal": normal, "where": [row[2] for row in RECEIVERS]},
        "cases": cases,
    }


MAP_SIZE, MAP_REFINEMENT = 8, 2
"""Texels along the side of a visibility map, and rays along the side of a texel at a silhouette. A choice."""
VISIBILITY_RECEIVERS = [
    ([1.0, 0.9, -2.0], [0.0, 0.0, 1.0], "on the wall, in sight"),
    ([-1.55, 0.72, -2.0], [0.0, 0.0, 1.0], "on the wall, in the block's shadow"),
    (
        [-0.85, 0.31, -2.0],
        [0.0, 0.0, 1.0],
        "on the wall, beside the block's shadow: partly, with a large softness",
    ),
    ([-0.52, 0.33, -2.0], [0.0, 0.0, 1.0], "on the wall, in sight: looked up in a finer block"),
    ([-1.75, 1.77, -2.0], [0.0, 0.0, 1.0], "on the wall, over the block's shadow: partly"),
    ([-0.2, 0.5, -0.6], [1.0, 0.0, 0.0], "on the block's lit side"),
    ([-0.5, 0.8, -0.7], [0.0, 1.0, 0.0], "on the block's top: faces away"),
    ([-1.5, 0.4, -0.9], [0.8, -0.6, 0.0], "in the air, behind the block"),
    ([1.0, -0.1, 0.5], [0.0, 1.0, 0.0], "below the VPL's plane"),
]
BIASES = [(0.0005, 0.001), (0.05, 0.3)]


def cast_map(vpl: dict) -> dict[str, np.ndarray]:
    """The map of one VPL of the boxes: ends [L] and normals in its frame, and finer blocks at silhouettes."""
    size, refinement = MAP_SIZE, MAP_REFINEMENT
    end, normal = _cast(vpl, size)
    farthest = visibility_maps.FARTHEST * diagonal() / LENGTH
    silhouette = visibility_maps.is_silhouette(end, normal, farthest)
    block = np.full((size, size), -1)
    block[silhouette] = np.arange(silhouette.sum())
    fine_end, fine_normal = _cast(vpl, size * refinement)

    def blocks(values: np.ndarray) -> np.ndarray:
        return values.reshape(size, refinement, size, refinement, 3).swapaxes(1, 2)[silhouette]

    return {
        "end": end,
        "normal": normal,
        "corner": np.where(silhouette, 1, visibility_maps.corner_marks(end, normal, farthest)),
        "block": block,
        "block_end": blocks(fine_end),
        "block_normal": blocks(fine_normal),
    }


def diagonal() -> float:
    """The diagonal of the scene's bounds, beyond which no ray meets anything."""
    low, high = box_scene.bounds(BOXES)
    return float(np.linalg.norm(high - low))


def _cast(vpl: dict, size: int) -> tuple[np.ndarray, np.ndarray]:
    frame = visibility_maps.hemisphere_frame(vpl["normal"])
    origin = visibility_maps.map_origin(vpl["position"], vpl["normal"], vpl["footprint"])
    end, normal = np.zeros((size, size, 3)), np.zeros((size, size, 3))
    for row, column in np.ndindex(size, size):
        axis = visibility_maps.texel_axis(np.float64(column), np.float64(row), size)
        distance, box, met_normal = box_scene.nearest_hit(BOXES, origin, frame.T @ axis)
        met = box >= 0 and distance < diagonal()
        end[row, column] = axis * (distance if met else visibility_maps.NOTHING * diagonal()) / LENGTH
        normal[row, column] = frame @ met_normal if met else -axis
    return end, normal


def map_vpl() -> dict[str, Any]:
    """The VPL whose map is made: near the first of the gather's, from where no ray runs along an edge."""
    vpl = dict(zip(("position", "normal", "footprint"), map(np.array, VPLS[0]), strict=False))
    return vpl | {"position": vpl["position"] + [0.003, 0.0, 0.007]}


def _visibility() -> dict[str, Any]:
    vpl = map_vpl()
    maps = cast_map(vpl)
    frame = visibility_maps.hemisphere_frame(vpl["normal"])
    origin = visibility_maps.map_origin(vpl["position"], vpl["normal"], vpl["footprint"])
    normals = [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.48, -0.6, 0.64], [0.36, 0.48, -0.8]]
    row, column = np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij")
    seen = []
    for position, normal, where in VISIBILITY_RECEIVERS:
        shares = [
            visibility_maps.vpl_visibility(np.array(position), np.array(normal), vpl, maps, LENGTH, *pair)
            for pair in BIASES
        ]
        seen.append({"position": position, "normal": normal, "where": where, "seen_share": shares})
    return {
        "frames": [
            {"normal": each, "rows": visibility_maps.hemisphere_frame(np.array(each))} for each in normals
        ],
        "axes_of_4x4": visibility_maps.texel_axis(column, row, 4),
        "overlaps": [_overlap(*case) for case in OVERLAPS],
        "scene_length": LENGTH,
        "diagonal": diagonal(),
        "vpl": vpl,
        "origin": origin,
        "frame": frame,
        "map": maps,
        "bias_softness": BIASES,
        "receivers": seen,
    }


# end, end normal, receiver, receiver normal; in the VPL's frame [L]
OVERLAPS = [
    ([0.3, 0.1, 0.5], [0.0, 0.0, -1.0], [0.6, 0.2, 1.1], [-0.6, 0.0, -0.8]),
    ([0.6, 0.2, 1.0999], [-0.6, 0.0, -0.8], [0.6, 0.2, 1.1], [-0.6, 0.0, -0.8]),
    ([1.2, 0.4, 2.2], [0.0, 0.0, -1.0], [0.6, 0.2, 1.1], [-0.6, 0.0, -0.8]),
    ([0.5, 0.2, 0.9], [0.0, -0.6, -0.8], [0.55, 0.21, 1.0], [0.0, 0.0, -1.0]),
]


def _overlap(*case: list[float]) -> dict[str, Any]:
    end, end_normal, receiver, normal = map(np.array, case)
    overlap = float(visibility_maps.overlap(end, end_normal, receiver, normal))
    return {
        "end": end,
        "end_normal": end_normal,
        "receiver": receiver,
        "receiver_normal": normal,
        "overlap": overlap,
        "seen_share": [float(visibility_maps.seen_share(overlap, *pair)) for pair in BIASES],
    }


def _display() -> dict[str, Any]:
    colors = np.array(
        [[0, 0, 0], [0.02, 0.05, 0.01], [0.3, 0.5, 0.7], [0.7, 0.79, 0.9], [4.0, 1.0, 0.2], [50, 60, 70]]
    )
    encoded = display.srgb_encode(display.tone_curve(colors))
    return {"exposed_radiance": colors, "srgb": encoded, "bytes": np.floor(255.0 * encoded + 0.5).astype(int)}


if __name__ == "__main__":
    assert math.isclose(float(np.linalg.norm(SPOT["direction"])), 1.0)
    FILE.write_text(json_text(plain(test_vectors())) + "\n", encoding="utf-8")
