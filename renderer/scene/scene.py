"""A scene in plain arrays: meshes, materials, textures, lights, cameras and what is around it.

The runtime and the reference renderer share this description. Every surface is diffuse and two-sided;
some have holes, or let a share of the light pass. Lengths are in world units.

Colours are linear, in the Rec. 709 primaries, unless a name says sRGB.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Float32, Float64, Int32, UInt8

from vpltune.renderer.scene.environment import Environment
from vpltune.renderer.scene.scene_animation import Animation, Skinning

# A choice: points under all matrices that are bounded at a time. 32,768 × 3 doubles stay in a core's cache.
_BOUND_CHUNK = 1 << 15

Wrap = Literal["repeat", "mirrored_repeat", "clamp_to_edge"]
AlphaMode = Literal["opaque", "mask", "blend"]
LightKind = Literal["spot", "point", "directional"]
Numbers = float | int | np.generic | Sequence[Any] | np.ndarray
"""What becomes an array of float64: a number, a sequence of them, of any depth, or an array."""


@dataclass(frozen=True, eq=False)
class Texture:
    """A base-colour image: sRGB-encoded bytes, row 0 at the top (v = 0, as in glTF).

    Lookups decode the texels to linear values first, then filter them bilinearly.
    """

    name: str
    texels_srgb: UInt8[np.ndarray, "height width 3"]
    wrap_u: Wrap = "repeat"
    wrap_v: Wrap = "repeat"
    opacity: UInt8[np.ndarray, "height width"] | None = None
    """Opacity of the texels in 255ths, filtered bilinearly; None where all are opaque."""


@dataclass(frozen=True, eq=False)
class Material:
    """A diffuse material: albedo = base_color · texture(uv) · vertex colour.

    An absent texture or vertex colour counts as 1. `base_color` is linear, in [0, 1].

    The opacity at a point is `opacity` times the texture's there. With the alpha mode `mask`, the surface is
    where that is at least `alpha_cutoff`, and has holes elsewhere: for the camera, for light and for shadows.
    With `blend`, it stops this share of the light and lets the rest pass straight through; the camera sees it
    where that is at least `alpha_cutoff`, and what is behind it elsewhere.
    """

    name: str
    base_color: Float32[np.ndarray, "3"]
    texture: int | None = None
    """Index into `Scene.textures`."""
    alpha_mode: AlphaMode = "opaque"
    opacity: float = 1.0
    """In [0, 1]; `opaque` ignores it."""
    alpha_cutoff: float = 0.5
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Radiance that the surface emits in every direction, RGB in W/(m² sr), each ≥ 0."""
    emission_texture: int | None = None
    """Index into `Scene.textures` of a factor of the emission. Its opacity is ignored."""
    emits_both_ways: bool = False
    """Whether the back emits too. The front is the side from where triangles run counter-clockwise as they
    stand in the world; a reader turns meshes that a mirrored node would turn round."""

    @property
    def is_opaque(self) -> bool:
        """Whether the surface stops all light, everywhere."""
        return self.alpha_mode == "opaque"

    @property
    def is_blended(self) -> bool:
        """Whether the surface stops a share of the light."""
        return self.alpha_mode == "blend"

    @property
    def glows(self) -> bool:
        """Whether the surface emits light of its own."""
        return any(self.emission)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with one material, in the mesh's local space.

    `normals` have unit length. They come from the file; without any there, shading is flat. `uv` already
    includes any KHR_texture_transform. `colors` are linear.
    """

    name: str
    positions: Float32[np.ndarray, "vertices 3"]
    normals: Float32[np.ndarray, "vertices 3"]
    uv: Float32[np.ndarray, "vertices 2"]
    colors: Float32[np.ndarray, "vertices 3"]
    triangles: Int32[np.ndarray, "triangles 3"]
    material: int
    """Index into `Scene.materials`."""
    skinning: Skinning | None = None
    """The joints that deform the mesh, if they are animated. Positions and normals are then the rest pose."""

    def __repr__(self) -> str:
        return f"Mesh({self.name!r}, {len(self.positions):,} vertices, {len(self.triangles):,} triangles)"


@dataclass(frozen=True, eq=False)
class Instance:
    """One mesh placed in the world."""

    name: str
    mesh: int
    """Index into `Scene.meshes`."""
    to_world: Float64[np.ndarray, "4 4"]


@dataclass(frozen=True, eq=False, init=False)
class Camera:
    """A pinhole camera. `to_world` is rigid; the camera looks along its −Z axis, with +Y up.

    Example:
        >>> Camera(look_at([0, 1, 4], [0, 1, 0]), yfov=0.9)
    """

    to_world: Float64[np.ndarray, "4 4"]
    yfov: float
    """Full vertical field of view in radians, in (0, π)."""
    name: str
    """Empty where it comes from no file, or has no name there."""

    def __init__(self, to_world: Numbers, yfov: float, name: str = "") -> None:
        object.__setattr__(self, "to_world", np.array(to_world, np.float64))
        object.__setattr__(self, "yfov", float(yfov))
        object.__setattr__(self, "name", name)

    @property
    def position_world(self) -> Float64[np.ndarray, "3"]:
        """The camera's position in world units."""
        return self.to_world[:3, 3]

    @property
    def world_to_camera(self) -> Float64[np.ndarray, "4 4"]:
        """The inverse of `to_world`."""
        rotation = self.to_world[:3, :3]
        inverse = np.eye(4)
        inverse[:3, :3] = rotation.T
        inverse[:3, 3] = -rotation.T @ self.position_world
        return inverse


@dataclass(frozen=True, eq=False, init=False)
class Light:
    """A punctual light as in KHR_lights_punctual, in radiometric units: W/sr for candela, W/m² for lux.

    A spot's intensity falls off between `inner_cone` and `outer_cone` (half angles in radians,
    0 ≤ inner < outer ≤ π/2) by the factor clamp((cos θ − cos outer)/(cos inner − cos outer), 0, 1)², as
    KHR_lights_punctual specifies. A spot or point light with a `range` gives max(1 − (d/range)⁴, 0) of the
    irradiance that it would give without one at the distance d, as that extension recommends.

    Vectors may be given as any three numbers, and an intensity as one number for a white light.

    Example:
        >>> Light("spot", 10.0, position_world=[0, 2, 0], direction_world=[0, -1, 0])

    Raises:
        ValueError: the direction of a spot or directional light does not have unit length, or the range is
            not positive.
    """

    kind: LightKind
    intensity: Float64[np.ndarray, "3"]
    """RGB: W/sr for spot and point lights, W/m² perpendicular to the beam for directional lights."""
    position_world: Float64[np.ndarray, "3"]
    """World units. A directional light ignores it."""
    direction_world: Float64[np.ndarray, "3"]
    """Unit vector in which the light travels. A point light ignores it."""
    inner_cone: float
    outer_cone: float
    name: str
    range: float
    """World units, > 0; infinite where the light does not end. A directional light ignores it."""

    def __init__(
        self,
        kind: LightKind,
        intensity: Numbers,
        position_world: Numbers = (0.0, 0.0, 0.0),
        direction_world: Numbers = (0.0, 0.0, -1.0),
        inner_cone: float = 0.0,
        outer_cone: float = float(np.pi / 4),
        name: str = "",
        range: float = math.inf,
    ) -> None:
        white = np.ones(3) if np.ndim(intensity) == 0 else 1.0
        values = {
            "kind": kind,
            "intensity": np.asarray(intensity, np.float64) * white,
            "position_world": np.array(position_world, np.float64),
            "direction_world": np.array(direction_world, np.float64),
            "inner_cone": float(inner_cone),
            "outer_cone": float(outer_cone),
            "name": name,
            "range": float(range),
        }
        for field_name, value in values.items():
            object.__setattr__(self, field_name, value)
        length = float(np.linalg.norm(self.direction_world))
        # 1e-4 tolerates single precision and numbers written with five digits.
        if self.kind != "point" and not abs(length - 1.0) <= 1e-4:
            raise ValueError(
                f"Light.direction_world: must be a unit vector, got {self.direction_world.tolist()} "
                f"of length {length:.6g}"
            )
        if not self.range > 0.0:
            raise ValueError(f"Light.range: must be positive, got {self.range:g}")


@dataclass(frozen=True, eq=False)
class Scene:
    """Geometry, materials, and the lights and cameras in the file (often none)."""

    name: str
    meshes: tuple[Mesh, ...]
    instances: tuple[Instance, ...]
    materials: tuple[Material, ...]
    textures: tuple[Texture, ...] = ()
    lights: tuple[Light, ...] = ()
    cameras: tuple[Camera, ...] = ()
    warnings: tuple[str, ...] = ()
    """One line for each kind of content in the file that is ignored or approximated."""
    animation: Animation | None = None
    """The motion, if any. All other fields describe the rest pose."""
    environment: Environment | None = None
    """Light from far away all around, if any."""

    def __repr__(self) -> str:
        counts = {
            "triangle": self.triangle_count(),
            "instance": len(self.instances),
            "material": len(self.materials),
            "texture": len(self.textures),
            "light": len(self.lights),
            "camera": len(self.cameras),
        }
        said = [f"{count:,} {what}{'s' * (count != 1)}" for what, count in counts.items() if count]
        moves = [] if self.animation is None else ["animated"]
        return f"Scene({', '.join([repr(self.name), *said, *moves])})"

    def triangle_count(self) -> int:
        """Triangles of all instances; a mesh counts once per instance."""
        return sum(len(self.meshes[instance.mesh].triangles) for instance in self.instances)

    def bounds(self) -> Float64[np.ndarray, "2 3"]:
        """Axis-aligned bounds of all instances in world units: the low corner, then the high corner."""
        placed: dict[int, list[np.ndarray]] = {}
        for instance in self.instances:
            placed.setdefault(instance.mesh, []).append(instance.to_world)
        corners = [
            _placed_bounds(self.meshes[mesh].positions, np.array(matrices))
            for mesh, matrices in placed.items()
        ]
        return np.stack([np.min([low for low, _ in corners], 0), np.max([high for _, high in corners], 0)])


def _placed_bounds(
    points: Float32[np.ndarray, "n 3"], matrices: Float64[np.ndarray, "k 4 4"]
) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """The low and the high corner of all points under each matrix.

    An instance whose box lies inside what others reach changes nothing, and its points are not placed.
    """
    if len(matrices) == 1 or not len(points):
        return _points_bounds(points, matrices)
    # The points' box under each matrix: an outer bound for both corners.
    least, most = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    middle = matrices[:, :3, :3] @ (0.5 * (least + most)) + matrices[:, :3, 3]
    reach = np.abs(matrices[:, :3, :3]) @ (0.5 * (most - least))
    outer = np.concatenate([reach - middle, reach + middle], axis=1)
    first = np.unique(outer.argmax(axis=0))
    low, high = _points_bounds(points, matrices[first])
    # Far above rounding, so that the result is that of all points, to the last bit.
    slack = 1e-12 * np.abs(outer).max()
    rest = (outer >= np.concatenate([-low, high]) - slack).any(axis=1)
    rest[first] = False
    if rest.any():
        others = _points_bounds(points, matrices[rest])
        low, high = np.minimum(low, others[0]), np.maximum(high, others[1])
    return low, high


def _points_bounds(
    points: Float32[np.ndarray, "n 3"], matrices: Float64[np.ndarray, "k 4 4"]
) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """As `_placed_bounds`, from every point under every matrix. It takes 4 ns for each."""
    low, high = np.full((len(matrices), 3), np.inf), np.full((len(matrices), 3), -np.inf)
    for first in range(0, len(points), _BOUND_CHUNK):
        chunk = np.ascontiguousarray(points[first : first + _BOUND_CHUNK].astype(np.float64).T)
        at_a_time = max(1, _BOUND_CHUNK // chunk.shape[1])
        for start in range(0, len(matrices), at_a_time):
            rows = slice(start, start + at_a_time)
            turned = matrices[rows, :3, :3] @ chunk
            np.minimum(low[rows], turned.min(axis=2), out=low[rows])
            np.maximum(high[rows], turned.max(axis=2), out=high[rows])
    return (low + matrices[:, :3, 3]).min(axis=0), (high + matrices[:, :3, 3]).max(axis=0)


def scaled(scene: Scene, factor: float) -> Scene:
    """The scene scaled by `factor`, lights and cameras included.

    Point and spot intensities are scaled by factor², so irradiance and the image stay the same.
    """
    grow = np.diag([factor, factor, factor, 1.0])
    return Scene(
        name=scene.name,
        meshes=scene.meshes,
        instances=tuple(Instance(i.name, i.mesh, grow @ i.to_world) for i in scene.instances),
        materials=scene.materials,
        textures=scene.textures,
        lights=tuple(scaled_light(light, factor) for light in scene.lights),
        cameras=tuple(scaled_camera(camera, factor) for camera in scene.cameras),
        warnings=scene.warnings,
        animation=None
        if scene.animation is None
        else replace(scene.animation, root_to_world=grow @ scene.animation.root_to_world),
        environment=scene.environment,
    )


def scaled_light(light: Light, factor: float) -> Light:
    """The light for a scene scaled by `factor`: it gives corresponding points the same irradiance."""
    power = 1.0 if light.kind == "directional" else factor**2
    return Light(
        kind=light.kind,
        intensity=light.intensity * power,
        position_world=light.position_world * factor,
        direction_world=light.direction_world,
        inner_cone=light.inner_cone,
        outer_cone=light.outer_cone,
        name=light.name,
        range=light.range * factor,
    )


def scaled_camera(camera: Camera, factor: float) -> Camera:
    """The camera for a scene scaled by `factor`: it frames the same image."""
    to_world = camera.to_world.copy()
    to_world[:3, 3] *= factor
    return replace(camera, to_world=to_world)
