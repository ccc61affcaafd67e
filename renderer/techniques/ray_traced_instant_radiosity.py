"""Instant radiosity (Keller 1997): VPLs where rays from the lights meet the scene, traced on the CPU.

Every ray is tried against every triangle, which serves scenes of some thousand triangles.
"""

import math

import numpy as np

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.frame.point_table import r2_sequence
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.scene.light_range import range_falloff
from vpltune.renderer.scene.scene import Light, Scene
from vpltune.renderer.scene.spot_cone import cone_scale
from vpltune.renderer.scene.transforms import transform_points
from vpltune.renderer.scene.views import View
from vpltune.renderer.techniques.gathered_vpls import VPL_DTYPE, GatheredVpls

MIN_COSINE = 0.02
"""Bounds the area that a ray stands for at grazing incidence, as RSM_MIN_COSINE does for a texel."""
_TRIANGLES_AT_ONCE = 4096
"""Triangles that all rays are tried against at once. A choice, for memory."""


class RayTracedInstantRadiosity:
    """Scene, lights → irradiance of a drawn frame; `count` rays are shared out evenly among the lights."""

    def __init__(self, frame: Frame, scene: Scene, count: int):
        self._scene = scene
        self._vpls = GatheredVpls(frame, count)

    def draw(self, view: View, inputs: FrameInputs) -> Resources:
        """Trace anew and gather for a view that the frame has just drawn; see `GatheredVpls.draw`."""
        self._vpls.upload(traced_vpls(self._scene, view.lights, self._vpls.count))
        return self._vpls.draw(inputs)


def traced_vpls(scene: Scene, lights: tuple[Light, ...], count: int) -> np.ndarray:
    """[count] of `VPL_DTYPE`: the ends of rays from the lights; those that hit nothing have no flux."""
    vpls = np.zeros(count, VPL_DTYPE)
    vpls["normal"][:] = (0.0, 0.0, 1.0)
    bounds = scene.bounds()
    for part, light in zip(np.array_split(np.arange(count), max(1, len(lights))), lights, strict=False):
        origin, direction, share = _rays(light, r2_sequence(len(part)).astype(np.float64), bounds)
        distance, instance, triangle, weights = _nearest_hits(scene, origin, direction)
        hit = np.flatnonzero(np.isfinite(distance))
        albedo, normal = _surfaces(scene, instance[hit], triangle[hit], weights[hit])
        cosine = -(normal * direction[hit]).sum(axis=1)
        normal *= np.where(cosine < 0.0, -1.0, 1.0)[:, None]
        spread = np.ones(len(hit)) if light.kind == "directional" else distance[hit] ** 2
        area = share * spread / np.maximum(np.abs(cosine), MIN_COSINE)
        into = part[hit]
        vpls["position"][into] = origin[hit] + distance[hit, None] * direction[hit]
        vpls["normal"][into] = normal
        vpls["area"][into] = area
        vpls["footprint"][into] = np.sqrt(area / np.pi)
        left = _cone_falloff(light, direction[hit]) * range_falloff(light, distance[hit])
        vpls["flux"][into] = light.intensity * (left * share)[:, None] * albedo
    return vpls


def _rays(light: Light, points: np.ndarray, bounds: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Origins, unit directions, and what one ray stands for: solid angle, or area across the beam."""
    if light.kind == "directional":
        right, up = _basis(light.direction_world)
        radius = float(np.linalg.norm(bounds[1] - bounds[0])) / 2.0
        offset = (2.0 * points - 1.0) * radius
        middle = bounds.mean(axis=0) - light.direction_world * radius
        origin = middle + offset[:, :1] * right + offset[:, 1:] * up
        direction = np.tile(light.direction_world, (len(points), 1))
        return origin, direction, (2.0 * radius) ** 2 / len(points)
    lowest = math.cos(light.outer_cone) if light.kind == "spot" else -1.0
    axis = light.direction_world if light.kind == "spot" else np.array([0.0, 0.0, 1.0])
    right, up = _basis(axis)
    cosine = 1.0 - points[:, 0] * (1.0 - lowest)
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    turn = 2.0 * np.pi * points[:, 1]
    direction = (
        cosine[:, None] * axis + (sine * np.cos(turn))[:, None] * right + (sine * np.sin(turn))[:, None] * up
    )
    origin = np.tile(light.position_world, (len(points), 1))
    return origin, direction, 2.0 * np.pi * (1.0 - lowest) / len(points)


def _cone_falloff(light: Light, direction: np.ndarray) -> np.ndarray:
    """KHR_lights_punctual, "Inner and Outer Cone Angles"."""
    if light.kind != "spot":
        return np.ones(len(direction))
    above = direction @ light.direction_world - math.cos(light.outer_cone)
    return np.clip(above * cone_scale(light.inner_cone, light.outer_cone), 0.0, 1.0) ** 2


def _basis(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors square to `axis` and to each other."""
    least = np.eye(3)[np.argmin(np.abs(axis))]
    right = np.cross(axis, least)
    right /= np.linalg.norm(right)
    return right, np.cross(right, axis)


def _nearest_hits(
    scene: Scene, origin: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Distance (infinite: none), instance, triangle and barycentric weights; Möller and Trumbore (1997)."""
    rays = np.arange(len(origin))
    nearest = np.full(len(origin), np.inf)
    instance, triangle = np.zeros((2, len(origin)), int)
    weights = np.zeros((len(origin), 3))
    for number, placed in enumerate(scene.instances):
        mesh = scene.meshes[placed.mesh]
        corners = transform_points(placed.to_world, mesh.positions)[mesh.triangles].astype(np.float64)
        for start in range(0, len(corners), _TRIANGLES_AT_ONCE):
            distance, u, v = _intersections(origin, direction, corners[start : start + _TRIANGLES_AT_ONCE])
            first = distance.argmin(axis=1)
            closer = distance[rays, first] < nearest
            chosen = (rays[closer], first[closer])
            nearest[closer] = distance[chosen]
            instance[closer], triangle[closer] = number, start + chosen[1]
            weights[closer] = np.stack([1.0 - u[chosen] - v[chosen], u[chosen], v[chosen]], axis=1)
    return nearest, instance, triangle, weights


def _intersections(
    origin: np.ndarray, direction: np.ndarray, corners: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """[rays, triangles]: distance (infinite: no hit) and the weights of the second and third corner."""
    edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(direction[:, None], edge_2[None])
    determinant = (across * edge_1).sum(axis=-1)
    from_corner = origin[:, None] - corners[None, :, 0]
    along = np.cross(from_corner, edge_1[None])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        u = (from_corner * across).sum(axis=-1) / determinant
        v = (direction[:, None] * along).sum(axis=-1) / determinant
        distance = (along * edge_2).sum(axis=-1) / determinant
        hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance > 0.0) & (determinant != 0.0)
    return np.where(hit, distance, np.inf), u, v


def _surfaces(
    scene: Scene, instance: np.ndarray, triangle: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Albedo and geometric normal under each hit; textures by their nearest texel."""
    albedo = np.zeros((len(instance), 3))
    normal = np.zeros((len(instance), 3))
    for number in np.unique(instance):
        at = instance == number
        placed = scene.instances[number]
        mesh = scene.meshes[placed.mesh]
        material = scene.materials[mesh.material]
        corners = mesh.triangles[triangle[at]]
        albedo[at] = material.base_color * np.einsum("nc,nck->nk", weights[at], mesh.colors[corners])
        if material.texture is not None:
            uv = np.einsum("nc,nck->nk", weights[at], mesh.uv[corners])
            albedo[at] *= _texels(scene, material.texture, uv)
        points = transform_points(placed.to_world, mesh.positions)[corners].astype(np.float64)
        square = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        normal[at] = square / np.linalg.norm(square, axis=1, keepdims=True)
    return albedo, normal


def _texels(scene: Scene, texture: int, uv: np.ndarray) -> np.ndarray:
    source = scene.textures[texture]
    height, width, _ = source.texels_srgb.shape
    places = []
    for coordinate, size, wrap in ((uv[:, 0], width, source.wrap_u), (uv[:, 1], height, source.wrap_v)):
        if wrap == "mirrored_repeat":
            coordinate = 1.0 - np.abs(coordinate % 2.0 - 1.0)
        elif wrap == "repeat":
            coordinate = coordinate % 1.0
        places.append(np.clip((coordinate * size).astype(int), 0, size - 1))
    return linear_from_srgb(source.texels_srgb[places[1], places[0]].astype(np.float64) / 255.0)
