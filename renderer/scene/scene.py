"""What a scene is, in plain arrays: the one description that runtime and reference share.

Every surface is two-sided and diffuse. Positions are in world units; nothing else in the program
is. Colours are linear reflectance or radiance in the Rec. 709 primaries unless a name says sRGB.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64, Int32, UInt8

from vpltune.renderer.scene.scene_animation import Animation, Skinning

Wrap = Literal["repeat", "mirrored_repeat", "clamp_to_edge"]
LightKind = Literal["spot", "point", "directional"]


@dataclass(frozen=True, eq=False)
class Texture:
    """An image of base colour, as stored: sRGB-encoded bytes, row 0 at the top (v = 0, as in glTF).

    It is always looked up with bilinear filtering, of decoded (linear) texels.
    """

    name: str
    texels_srgb: UInt8[np.ndarray, "height width 3"]
    wrap_u: Wrap = "repeat"
    wrap_v: Wrap = "repeat"


@dataclass(frozen=True, eq=False)
class Material:
    """Albedo = base_color · texture(uv) · vertex colour, each 1 where absent; in [0, 1]."""

    name: str
    base_color: Float32[np.ndarray, "3"]
    texture: int | None = None
    """Index into `Scene.textures`."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one material, in the mesh's own space.

    `normals` are unit length, and the file's own where it has them (else flat). `uv` has any
    KHR_texture_transform applied. `colors` are linear.
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
    """Where an animation bends the mesh; positions and normals are then those of the scene at rest."""


@dataclass(frozen=True, eq=False)
class Instance:
    """One mesh placed in the world."""

    name: str
    mesh: int
    """Index into `Scene.meshes`."""
    to_world: Float64[np.ndarray, "4 4"]


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole. `to_world` is rigid: the camera looks along its −Z, with +Y up."""

    to_world: Float64[np.ndarray, "4 4"]
    yfov: float
    """Full vertical angle of view in radians, in (0, π)."""

    @property
    def position_world(self) -> Float64[np.ndarray, "3"]:
        return self.to_world[:3, 3]

    @property
    def world_to_camera(self) -> Float64[np.ndarray, "4 4"]:
        rotation = self.to_world[:3, :3]
        inverse = np.eye(4)
        inverse[:3, :3] = rotation.T
        inverse[:3, 3] = -rotation.T @ self.position_world
        return inverse


@dataclass(frozen=True, eq=False)
class Light:
    """A punctual light (KHR_lights_punctual), radiometric: candela are W/sr, lux are W/m².

    A spot's intensity falls from `inner_cone` to `outer_cone` (half angles, radians) as
    KHR_lights_punctual says: clamp((cos θ − cos outer)/(cos inner − cos outer), 0, 1)².

    Raises:
        ValueError: the direction of a light that has one is not of unit length.
    """

    kind: LightKind
    intensity: Float64[np.ndarray, "3"]
    """W/sr for spot and point, W/m² across the beam for directional."""
    position_world: Float64[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))
    """Unused by a directional light."""
    direction_world: Float64[np.ndarray, "3"] = field(default_factory=lambda: np.array([0.0, 0.0, -1.0]))
    """Unit vector, the way the light travels; unused by a point light."""
    inner_cone: float = 0.0
    outer_cone: float = float(np.pi / 4)
    name: str = ""

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.direction_world))
        # 1e-4: as far as single precision and numbers written with five digits are off.
        if self.kind != "point" and not abs(length - 1.0) <= 1e-4:
            raise ValueError(
                f"Light.direction_world: must be a unit vector, got {self.direction_world.tolist()} "
                f"of length {length:.6g}"
            )


@dataclass(frozen=True, eq=False)
class Scene:
    """Geometry, materials, and what lights and cameras the file itself brings (often none)."""

    name: str
    meshes: tuple[Mesh, ...]
    instances: tuple[Instance, ...]
    materials: tuple[Material, ...]
    textures: tuple[Texture, ...] = ()
    lights: tuple[Light, ...] = ()
    cameras: tuple[Camera, ...] = ()
    warnings: tuple[str, ...] = ()
    """One line for each thing in the file that is ignored or approximated."""
    animation: Animation | None = None
    """How it moves; everything else here is the scene at rest."""

    def triangle_count(self) -> int:
        return sum(len(self.meshes[instance.mesh].triangles) for instance in self.instances)

    def bounds(self) -> Float64[np.ndarray, "2 3"]:
        """Axis-aligned bounds over all placed vertices, world units: rows are low and high corner."""
        corners = [
            transform_points(instance.to_world, self.meshes[instance.mesh].positions)
            for instance in self.instances
        ]
        return np.stack(
            [
                np.min([points.min(axis=0) for points in corners], axis=0),
                np.max([points.max(axis=0) for points in corners], axis=0),
            ]
        )


def transform_points(
    matrix: Float64[np.ndarray, "4 4"], points: Float32[np.ndarray, "n 3"] | Float64[np.ndarray, "n 3"]
) -> Float64[np.ndarray, "n 3"]:
    """Affine map of points, in double precision."""
    return points.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def transform_normals(
    matrix: Float64[np.ndarray, "4 4"], normals: Float32[np.ndarray, "n 3"]
) -> Float64[np.ndarray, "n 3"]:
    """Unit normals under an affine map: by the cofactor matrix, which also serves mirrored nodes.

    A normal whose image is zero (a node scaled flat) stays zero.
    """
    linear = matrix[:3, :3]
    cofactors = np.stack(
        [np.cross(linear[1], linear[2]), np.cross(linear[2], linear[0]), np.cross(linear[0], linear[1])]
    )
    mapped = normals.astype(np.float64) @ cofactors.T
    length = np.linalg.norm(mapped, axis=1, keepdims=True)
    return np.divide(mapped, length, out=np.zeros_like(mapped), where=length > 0.0)


def trs_matrices(
    translation: Float64[np.ndarray, "n 3"],
    rotation: Float64[np.ndarray, "n 4"],
    scale: Float64[np.ndarray, "n 3"],
) -> Float64[np.ndarray, "n 4 4"]:
    """translation · rotation · scale; quaternions (x, y, z, w) of any length but zero."""
    x, y, z, w = (rotation / np.linalg.norm(rotation, axis=1, keepdims=True)).T
    matrices = np.zeros((len(scale), 4, 4))
    matrices[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1)
    matrices[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1)
    matrices[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1)
    matrices[:, :3, :3] *= scale[:, None, :]
    matrices[:, :3, 3] = translation
    matrices[:, 3, 3] = 1.0
    return matrices


def without_scale(to_world: Float64[np.ndarray, "4 4"]) -> Float64[np.ndarray, "4 4"] | None:
    """The rigid motion that keeps position, −Z direction and the plane of −Z and +Y.

    Returns:
        None where the matrix is so flat that it leaves no such plane.
    """
    depth = np.linalg.norm(to_world[:3, 2])
    if not depth > 0.0:
        return None
    backward = to_world[:3, 2] / depth
    right = np.cross(to_world[:3, 1], backward)
    width = np.linalg.norm(right)
    if not width > 0.0:
        return None
    rigid = np.eye(4)
    rigid[:3, 0], rigid[:3, 2] = right / width, backward
    rigid[:3, 1] = np.cross(backward, rigid[:3, 0])
    rigid[:3, 3] = to_world[:3, 3]
    return rigid


def look_at(
    eye: Float64[np.ndarray, "3"],
    target: Float64[np.ndarray, "3"],
    up: Float64[np.ndarray, "3"] | None = None,
) -> Float64[np.ndarray, "4 4"]:
    """Camera-to-world matrix of a camera at `eye` that looks at `target` along its −Z, +Y up.

    `up` defaults to world +Y, and to world −Z where the view is vertical to within 2.5 degrees.

    Raises:
        ValueError: `eye` and `target` coincide.
    """
    backward = np.asarray(eye, np.float64) - np.asarray(target, np.float64)
    distance = np.linalg.norm(backward)
    if not distance > 0.0:
        raise ValueError(f"look_at: eye and target must differ, got {tuple(eye)} twice")
    backward = backward / distance
    if up is None:
        up = np.array([0.0, 1.0, 0.0]) if abs(backward[1]) < 0.999 else np.array([0.0, 0.0, -1.0])
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = (
        right,
        np.cross(backward, right),
        backward,
        eye,
    )
    return matrix


def scaled(scene: Scene, factor: float) -> Scene:
    """The same scene `factor` times as large, lights included.

    Point and spot intensities grow with factor², so that irradiance, and the image, stay the same.
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
    )


def scaled_light(light: Light, factor: float) -> Light:
    """The light of a scene `factor` times as large: the same irradiance at the corresponding points."""
    power = 1.0 if light.kind == "directional" else factor**2
    return Light(
        kind=light.kind,
        intensity=light.intensity * power,
        position_world=light.position_world * factor,
        direction_world=light.direction_world,
        inner_cone=light.inner_cone,
        outer_cone=light.outer_cone,
        name=light.name,
    )


def scaled_camera(camera: Camera, factor: float) -> Camera:
    """The camera of a scene `factor` times as large: the same framing."""
    to_world = camera.to_world.copy()
    to_world[:3, 3] *= factor
    return Camera(to_world, camera.yfov)
