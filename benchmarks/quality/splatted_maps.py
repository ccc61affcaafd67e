"""Cast visibility maps against imperfect shadow maps, which are splatted from points (Ritschel et al. 2008).

Each VPL projects its own `POINTS` random points of the scene's surface into a `SIZE`² map. The nearest point
wins, and a splat is as wide as the point's share of the surface appears. Pull-push fills the holes. A VPL has
4,096 points, where a cast map takes some 1,500 rays.

The splatted maps are looked up in two ways: by the plane of the point, as cast maps are, and by depth, as in
the paper, with the one of `BIASES` that suits the scene best. Parameters are the defaults. Everything runs in
numpy, because only the error is compared.
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64, Int64

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import present_scenes
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.transforms import transform_points
from vpltune.tuner.evaluation.evaluate import surrogate_irradiance, traced_visibility
from vpltune.tuner.evaluation.prepare_scene import PreparedScene, SceneOptions, Stopwatch, prepare_scene
from vpltune.tuner.metrics.view_metrics import relmse
from vpltune.tuner.surrogate.captured_view import CapturedView, runtime_irradiance
from vpltune.tuner.surrogate.virtual_point_lights import gather_inputs
from vpltune.tuner.surrogate.vpl_visibility import (
    MapTexels,
    VisibilityParameters,
    hemi_octahedral_encode,
    hemisphere_frame,
    visibility_origin,
    vpl_visibility,
)

SCENES = (
    "cornell-box",
    "gallery",
    "godot-zdm2",
    "kajiya-cornell-box",
    "nvpro-cornellbox",
    "playcanvas-house",
)
VPLS = 256
"""VPLs of every view. A choice."""
SIZE = 64
"""Texels along the side of a splatted map. A choice: 64² texels for as many points."""
POINTS = 4096
"""Points of each VPL. A choice."""
POOL = 1 << 17
"""Points of the whole surface, of which each VPL takes its own at random. A choice."""
SEED = 2008
"""Seed of the points. A choice."""
WIDEST = 2
"""Texels that a splat reaches from its centre at most; closer surfaces leave holes. A choice."""
BIASES = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2)
"""Depth biases to try, as shares of the distance. A choice."""
FAR = 1e3
"""Distance in units of L of the wall that stands where no point was splatted at all: beyond any scene."""
LEAST_HEIGHT = 1e-9
"""World units above the VPL's plane to which lower points are lifted, so that every direction is finite."""
CONFIG = TunedConfig(ArtistParameters(vpl_count=VPLS), light=ONE_BOUNCE)


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points that are spread evenly over a scene's surface; lengths in world units."""

    position: Float64[np.ndarray, "points 3"]
    normal: Float64[np.ndarray, "points 3"]
    area: float
    """Area of the whole surface."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each scene, the relMSE of splatted maps by plane and by depth, and of rays, against cast maps."""
    present = present_scenes()
    names = [name for name in SCENES if name in present]
    found = []
    for index, name in enumerate(names):
        progress(f"splatted_maps: {name}", index / len(names))
        prepared = prepare_scene(
            present[name], SceneOptions(views=2), CONFIG, Stopwatch(), lambda stage, share: None
        )
        found += _scene_rows(name, prepared)
    progress("splatted_maps", 1.0)
    return found


def _scene_rows(name: str, prepared: PreparedScene) -> list[Row]:
    random = np.random.default_rng(SEED)
    points = surface_points(prepared.scene, POOL, random)
    by_plane, by_depth, cast, traced = [], [], [], []
    for view in prepared.views:
        texels = splatted_texels(view, points, random)
        receivers, vpls = gather_inputs(view.captured)
        planes = vpl_visibility(receivers, vpls, texels, VisibilityParameters.of(CONFIG.parameters))
        by_plane.append(_error(view, np.asarray(planes)))
        by_depth.append([_error(view, seen) for seen in _seen_by_depth(view, texels)])
        drawn = runtime_irradiance(prepared.runtime, CONFIG, view)
        cast.append(relmse(drawn[view.valid], view.reference.irradiance[view.valid]))
        traced.append(_error(view, traced_visibility(prepared.scene, view)))
    ours = float(np.mean(cast))
    return [
        Row(f"{name}_splatted", float(np.mean(by_plane)), "1", "cast maps", ours),
        Row(f"{name}_splatted_by_depth", float(np.mean(by_depth, axis=0).min()), "1", "cast maps", ours),
        Row(f"{name}_ray_traced", float(np.mean(traced)), "1", "cast maps", ours),
    ]


def surface_points(scene: Scene, count: int, random: np.random.Generator) -> SurfacePoints:
    """Draw `count` random points of the scene's surface, uniformly by area."""
    corners = np.concatenate(
        [
            transform_points(instance.to_world, mesh.positions)[mesh.triangles]
            for instance in scene.instances
            for mesh in (scene.meshes[instance.mesh],)
        ]
    ).astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(across, axis=1)
    chosen = random.choice(len(corners), count, p=twice_area / twice_area.sum())
    root, other = np.sqrt(random.random(count)), random.random(count)
    weights = np.stack([1.0 - root, root * (1.0 - other), root * other], axis=1)
    position = np.einsum("pc,pcx->px", weights, corners[chosen])
    return SurfacePoints(position, across[chosen] / twice_area[chosen, None], 0.5 * twice_area.sum())


def splatted_texels(view: CapturedView, points: SurfacePoints, random: np.random.Generator) -> MapTexels:
    """Splat the maps of a view's VPLs, in the form that `surface_overlap` takes."""
    captured = view.captured
    _, vpls = gather_inputs(captured)
    frames = np.asarray(hemisphere_frame(vpls.normal), np.float64)
    lift = np.asarray(visibility_origin(vpls) - vpls.position, np.float64) * captured.scene_length
    origins = captured.vpl_position_world.astype(np.float64) + lift
    width = np.sqrt(points.area / POINTS / np.pi)
    ends, normals = [], []
    for origin, frame in zip(origins, frames, strict=True):
        own = random.choice(len(points.position), POINTS, replace=False)
        offset = (points.position[own] - origin) @ frame.T
        normal = points.normal[own] @ frame.T
        normal *= np.where((offset * normal).sum(1) > 0.0, -1.0, 1.0)[:, None]
        nearest = _filled(_splatted(offset, width), np.linalg.norm(offset, axis=1))
        # Index -1, where nothing was splatted in the whole map: a distant wall that faces the VPL.
        far = np.array([[0.0, 0.0, FAR * captured.scene_length]])
        ends.append(np.concatenate([offset, far])[nearest] / captured.scene_length)
        normals.append(np.concatenate([normal, [[0.0, 0.0, -1.0]]])[nearest])
    shape = (len(origins), SIZE, SIZE)
    end, normal = (jnp.asarray(np.reshape(part, (-1, 3)), jnp.float32) for part in (ends, normals))
    return MapTexels(end, normal, jnp.zeros(shape, jnp.int32), jnp.full(shape, -1, jnp.int32), 1)


def _splatted(offset: Float64[np.ndarray, "points 3"], width: float) -> Int64[np.ndarray, "size size"]:
    """Index of the nearest point in each texel; -1 in holes. `width`: a splat's radius in world units."""
    distance, texel = np.linalg.norm(offset, axis=1), _texel(offset)
    # SIZE² texels share the 2π steradians of a hemisphere: the width of a texel at distance 1.
    texel_width = np.sqrt(2.0 * np.pi) / SIZE
    reach = np.minimum(np.rint(width / distance / texel_width - 0.5), WIDEST)
    nearest = np.full((SIZE, SIZE), -1, np.int64)
    far_first = np.argsort(-distance)
    far_first = far_first[offset[far_first, 2] > 0.0]
    for y in range(-WIDEST, WIDEST + 1):
        for x in range(-WIDEST, WIDEST + 1):
            order = far_first[reach[far_first] >= max(abs(x), abs(y))]
            row, column = texel[order, 1] + y, texel[order, 0] + x
            inside = (row >= 0) & (row < SIZE) & (column >= 0) & (column < SIZE)
            layer = np.full((SIZE, SIZE), -1, np.int64)
            layer[row[inside], column[inside]] = order[inside]
            nearest = _nearer(nearest, layer, distance)
    return nearest


def _filled(
    nearest: Int64[np.ndarray, "size size"], distance: Float64[np.ndarray, " points"]
) -> Int64[np.ndarray, "size size"]:
    """Fill holes by pull-push: a hole takes the nearest point of the smallest square that has any."""
    if len(nearest) == 1:
        return nearest
    coarse = nearest[::2, ::2]
    for y, x in ((0, 1), (1, 0), (1, 1)):
        coarse = _nearer(coarse, nearest[y::2, x::2], distance)
    coarse = _filled(coarse, distance)
    return np.where(nearest < 0, coarse.repeat(2, axis=0).repeat(2, axis=1), nearest)


def _nearer(
    a: Int64[np.ndarray, "rows columns"],
    b: Int64[np.ndarray, "rows columns"],
    distance: Float64[np.ndarray, " points"],
) -> Int64[np.ndarray, "rows columns"]:
    """The nearer point of two in each texel, given the distance of every point; -1 is farther than all."""
    distances = np.concatenate([distance, [np.inf]])
    return np.where(distances[b] < distances[a], b, a)


def _texel(offset: Float64[np.ndarray, "n 3"]) -> Int64[np.ndarray, "n 2"]:
    """Column and row of the texel in each direction; below the horizon, those of a texel at the border."""
    upper = np.concatenate([offset[:, :2], np.maximum(offset[:, 2:], LEAST_HEIGHT)], axis=1)
    direction = upper / np.linalg.norm(upper, axis=1, keepdims=True)
    place = (np.asarray(hemi_octahedral_encode(jnp.asarray(direction))) * 0.5 + 0.5) * SIZE
    return np.clip(place.astype(np.int64), 0, SIZE - 1)


def _seen_by_depth(view: CapturedView, texels: MapTexels) -> list[np.ndarray]:
    """Visibility by depth comparison, [receivers, vpls] in {0, 1}, for each of `BIASES`."""
    receivers, vpls = gather_inputs(view.captured)
    frames, origins = np.asarray(hemisphere_frame(vpls.normal)), np.asarray(visibility_origin(vpls))
    depth = np.linalg.norm(np.asarray(texels.end), axis=1).reshape(len(origins), SIZE, SIZE)
    seen = np.ones((len(BIASES), len(receivers.position), len(origins)), np.float32)
    for index, (origin, frame) in enumerate(zip(origins, frames, strict=True)):
        offset = ((np.asarray(receivers.position) - origin) @ frame.T).astype(np.float64)
        distance = np.linalg.norm(offset, axis=1)
        column, row = _texel(offset).T
        for number, bias in enumerate(BIASES):
            seen[number, :, index] = distance * (1.0 - bias) <= depth[index, row, column]
    return list(seen)


def _error(view: CapturedView, visibility: np.ndarray) -> float:
    """relMSE of the surrogate's image of a view with this visibility, [receivers, vpls]."""
    image = surrogate_irradiance(view, CONFIG.parameters, jnp.asarray(visibility))
    return relmse(image[view.valid], view.reference.irradiance[view.valid])
