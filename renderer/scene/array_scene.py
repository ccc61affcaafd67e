"""Scenes from numpy arrays, held to the rules that scene files are held to."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, Int64

from vpltune.renderer.scene.environment import Environment
from vpltune.renderer.scene.environment_baking import baked_environment
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings, label
from vpltune.renderer.scene.files.limits import (
    LARGEST_RADIOMETRIC,
    MAX_CAMERAS,
    MAX_IMAGE_SIDE,
    MAX_INSTANCES,
    MAX_LIGHTS,
    MAX_SCENE_TEXELS,
    DecodedBytes,
)
from vpltune.renderer.scene.files.reading_border import read_at_border
from vpltune.renderer.scene.files.surface import Surface, finished_mesh
from vpltune.renderer.scene.scene import Camera, Instance, Light, Material, Mesh, Numbers, Scene, Texture
from vpltune.renderer.scene.views import checked_camera, checked_light


def scene_from_arrays(
    positions: Numbers,
    triangles: Numbers,
    *,
    normals: Numbers | None = None,
    uv: Numbers | None = None,
    albedo: Numbers = 1.0,
    triangle_albedo: Numbers | None = None,
    texture: Numbers | None = None,
    emission: Numbers = 0.0,
    emits_both_ways: bool = False,
    name: str = "arrays",
    lights: Sequence[Light] = (),
    cameras: Sequence[Camera] = (),
    environment: Environment | None = None,
) -> Scene:
    """A scene of one mesh. Every surface is diffuse and two-sided; +Y is up where a camera is placed.

    A point's albedo is the product of `albedo`, `triangle_albedo` and `texture`; without any it is white.

    Args:
        positions: [vertices, 3], world units.
        triangles: [triangles, 3], whole numbers, indices into `positions`.
        normals: [vertices, 3], of any length; without them, shading is flat.
        uv: [vertices, 2], where v = 0 is the top row of the texture.
        albedo: one number, RGB, or [vertices, 3]; linear, in [0, 1].
        triangle_albedo: [triangles, 3]; linear, in [0, 1].
        texture: [height, width, 3], uint8, sRGB; needs `uv`.
        emission: radiance that the surface emits, one number or RGB, in W/(m² sr), from 0 to 1e18.
        emits_both_ways: whether the back emits too. The front is where triangles wind counter-clockwise.
        name: the scene's name.
        lights: the scene's own; without any, and where nothing else shines, one is placed.
        cameras: the scene's own; without any, one is placed.
        environment: light from far away all around, such as an `even_sky`.

    Raises:
        InputError: an argument breaks one of these rules; one line names argument, rule and value.

    Example:
        >>> floor = [[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]]
        >>> scene_from_arrays(floor, [[0, 1, 2], [0, 2, 3]], albedo=[0.7, 0.5, 0.3])
        Scene('arrays', 2 triangles, 1 instance, 1 material)
    """

    def made() -> Scene:
        builder = ArraySceneBuilder()
        mesh = builder.add_mesh(
            name,
            positions,
            triangles,
            normals=normals,
            uv=uv,
            albedo=albedo,
            triangle_albedo=triangle_albedo,
            texture=texture,
            emission=emission,
            emits_both_ways=emits_both_ways,
        )
        if mesh is None:
            raise SceneFileError("triangles: at least one must have area, got none that has")
        builder.place(name, mesh, np.eye(4))
        return builder.scene(name, lights, cameras, Warnings(), environment)

    return read_at_border("scene_from_arrays", made)


class ArraySceneBuilder:
    """Collects meshes and where they are placed. Its methods raise SceneFileError where a rule is broken."""

    def __init__(self) -> None:
        self._meshes: list[Mesh] = []
        self._instances: list[Instance] = []
        self._materials: list[Material] = []
        self._textures: list[Texture] = []
        self._decoded = DecodedBytes()
        self._texels = DecodedBytes(3 * MAX_SCENE_TEXELS, "textures")

    def add_mesh(
        self,
        name: str,
        positions: Numbers,
        triangles: Numbers,
        *,
        normals: Numbers | None = None,
        uv: Numbers | None = None,
        albedo: Numbers = 1.0,
        triangle_albedo: Numbers | None = None,
        texture: Numbers | None = None,
        emission: Numbers = 0.0,
        emits_both_ways: bool = False,
    ) -> int | None:
        """Add a mesh with a material of its own; the arguments are those of `scene_from_arrays`.

        Returns:
            Its index, for `place`; None if no triangle has area.
        """
        points = _rows(positions, 3, "positions")
        corners = _corners(triangles, len(points))
        base_color, colors = _albedo(albedo, len(points))
        surface = Surface(
            points,
            corners,
            normals=None if normals is None else _rows(normals, 3, "normals", len(points)),
            uv=None if uv is None else _rows(uv, 2, "uv", len(points)),
            colors=colors,
        )
        if triangle_albedo is not None:
            shades = _rows(triangle_albedo, 3, "triangle_albedo", len(corners))
            surface = _with_triangle_colors(surface, _in_unit_range(shades, "triangle_albedo"))
        if texture is not None and uv is None:
            raise SceneFileError("texture: must come with uv, got none")
        mesh = finished_mesh(surface, label(name, "mesh"), len(self._materials), self._decoded, "mesh")
        if mesh is None:
            return None
        image = None if texture is None else self._add_texture(texture, name)
        self._materials.append(
            Material(
                mesh.name,
                base_color,
                image,
                emission=_radiance(emission),
                emits_both_ways=bool(emits_both_ways),
            )
        )
        self._meshes.append(mesh)
        return len(self._meshes) - 1

    def place(self, name: str, mesh: int, to_world: Numbers) -> None:
        """Place a mesh, an index from `add_mesh`, in the world."""
        if len(self._instances) >= MAX_INSTANCES:
            raise SceneFileError(f"instances: must be at most {MAX_INSTANCES:,}")
        self._instances.append(Instance(label(name, "instance"), mesh, np.array(to_world, np.float64)))

    def scene(
        self,
        name: str,
        lights: Sequence[Light],
        cameras: Sequence[Camera],
        warnings: Warnings,
        environment: Environment | None = None,
    ) -> Scene:
        """The scene of all that was placed, with lights and cameras checked as those of `views.json` are."""
        for what, given, most in (("lights", lights, MAX_LIGHTS), ("cameras", cameras, MAX_CAMERAS)):
            if not isinstance(given, Sequence):
                raise SceneFileError(f"{what}: must be a sequence, got {type(given).__name__}")
            if len(given) > most:
                raise SceneFileError(f"{what}: must be at most {most:,}, got {len(given):,}")
        return Scene(
            name=label(name, "scene"),
            meshes=tuple(self._meshes),
            instances=tuple(self._instances),
            materials=tuple(self._materials),
            textures=tuple(self._textures),
            lights=tuple(checked_light(light, f"lights[{i}]") for i, light in enumerate(lights)),
            cameras=tuple(checked_camera(camera, f"cameras[{i}]") for i, camera in enumerate(cameras)),
            warnings=warnings.lines(),
            environment=None if environment is None else _checked_environment(environment),
        )

    def _add_texture(self, texture: Numbers, name: str) -> int:
        texels = np.asarray(texture)
        if texels.dtype != np.uint8 or texels.ndim != 3 or texels.shape[2] != 3 or not texels.size:
            raise SceneFileError(
                f"texture: must be uint8 [height, width, 3], got {texels.dtype} {list(texels.shape)}"
            )
        if max(texels.shape) > MAX_IMAGE_SIDE:
            raise SceneFileError(
                f"texture: must have at most {MAX_IMAGE_SIDE} rows and columns, got {list(texels.shape[:2])}"
            )
        self._texels.spend(texels.size, "texture")
        self._textures.append(Texture(label(name, "texture"), np.ascontiguousarray(texels)))
        return len(self._textures) - 1


def _rows(value: Numbers, width: int, what: str, count: int | None = None) -> Float32[np.ndarray, "rows _"]:
    """The rows of an array of numbers, `count` of them where it is given."""
    rows = _numbers(value, what)
    if rows.ndim != 2 or rows.shape[1] != width or (count is not None and len(rows) != count):
        wanted = "rows" if count is None else count
        raise SceneFileError(f"{what}: must have the shape [{wanted}, {width}], got {list(rows.shape)}")
    return rows.astype(np.float32)


def _numbers(value: Numbers, what: str) -> Float64[np.ndarray, "..."]:
    try:
        return np.asarray(value, np.float64)
    except (TypeError, ValueError) as error:
        raise SceneFileError(f"{what}: must be an array of numbers ({error})") from error


def _corners(triangles: Numbers, vertex_count: int) -> Int64[np.ndarray, "triangles 3"]:
    corners: Any = np.asarray(triangles)
    if corners.dtype.kind not in "iu":
        raise SceneFileError(f"triangles: must be whole numbers, got {corners.dtype}")
    if corners.ndim != 2 or corners.shape[1] != 3:
        raise SceneFileError(f"triangles: must have the shape [triangles, 3], got {list(corners.shape)}")
    if corners.size and (corners.min() < 0 or corners.max() >= vertex_count):
        wrong = corners.max() if corners.max() >= vertex_count else corners.min()
        raise SceneFileError(f"triangles: must be from 0 to below the {vertex_count} positions, got {wrong}")
    return corners.astype(np.int64)


def _albedo(
    albedo: Numbers, vertex_count: int
) -> tuple[Float32[np.ndarray, "3"], Float32[np.ndarray, "vertices 3"] | None]:
    """The material's base colour, and the colours of the vertices, if they have their own."""
    values = _numbers(albedo, "albedo")
    if values.shape not in ((), (3,), (vertex_count, 3)):
        raise SceneFileError(
            f"albedo: must be one number, RGB, or of the shape [{vertex_count}, 3], got {list(values.shape)}"
        )
    colors = _in_unit_range(values.astype(np.float32), "albedo")
    if values.ndim == 2:
        return np.ones(3, np.float32), colors
    return np.broadcast_to(colors, 3).copy(), None


def _radiance(emission: Numbers) -> tuple[float, float, float]:
    values = _numbers(emission, "emission")
    if values.shape not in ((), (3,)):
        raise SceneFileError(f"emission: must be one number or RGB, got {list(values.shape)}")
    wrong = ~((values >= 0.0) & (values <= LARGEST_RADIOMETRIC))
    if wrong.any():
        raise SceneFileError(
            f"emission: must be from 0 to {LARGEST_RADIOMETRIC:g}, got {values[wrong].flat[0]:g}"
        )
    red, green, blue = np.broadcast_to(values, 3).tolist()
    return red, green, blue


def _checked_environment(environment: Environment) -> Environment:
    """The environment, at most as large as those of files are drawn."""
    if not isinstance(environment, Environment):
        raise SceneFileError(f"environment: must be an Environment, got {type(environment).__name__}")
    radiance = environment.radiance
    if radiance.ndim != 3 or radiance.shape[2] != 3 or not radiance.size:
        raise SceneFileError(
            f"environment: radiance must have the shape [height, width, 3], got {list(radiance.shape)}"
        )
    if not (radiance.min() >= 0.0 and radiance.max() <= LARGEST_RADIOMETRIC):
        raise SceneFileError(
            f"environment: radiance must be from 0 to {LARGEST_RADIOMETRIC:g}, "
            f"got {radiance.min():g} to {radiance.max():g}"
        )
    return baked_environment([radiance[..., channel].astype(np.float32) for channel in range(3)])


def _in_unit_range(values: Float32[np.ndarray, "..."], what: str) -> Float32[np.ndarray, "..."]:
    wrong = ~((values >= 0.0) & (values <= 1.0))
    if wrong.any():
        raise SceneFileError(f"{what}: must lie in [0, 1], got {values[wrong].flat[0]:g}")
    return values


def _with_triangle_colors(surface: Surface, shades: Float32[np.ndarray, "triangles 3"]) -> Surface:
    """The surface with a vertex for each corner, whose colour is that of its triangle times its own."""
    corners = surface.triangles.ravel()
    colors = np.repeat(shades, 3, axis=0)

    def unshared(rows: np.ndarray | None) -> np.ndarray | None:
        return None if rows is None else rows[corners]

    return replace(
        surface,
        positions=surface.positions[corners],
        triangles=np.arange(corners.size, dtype=np.int64).reshape(-1, 3),
        normals=unshared(surface.normals),
        uv=unshared(surface.uv),
        colors=colors if surface.colors is None else colors * surface.colors[corners],
    )
