"""Scenes from trimesh, which need not be installed: its objects are known by what they have."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float32

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.array_scene import ArraySceneBuilder
from vpltune.renderer.scene.environment import Environment
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.reading_border import read_at_border
from vpltune.renderer.scene.scene import Camera, Light, Scene

# trimesh's colour of a material that was given none (trimesh.visual.color.DEFAULT_COLOR): read as white.
_NO_COLOR = (102, 102, 102)


def scene_from_trimesh(
    source: Any,
    *,
    smooth: bool = False,
    name: str = "trimesh",
    lights: Sequence[Light] = (),
    cameras: Sequence[Camera] = (),
    environment: Environment | None = None,
) -> Scene:
    """The scene of a `trimesh.Scene` or `trimesh.Trimesh`. +Y is up where a camera is placed.

    Colours of vertices and faces are taken as sRGB, as in a PLY file; factors of materials are linear. A
    material's image is its texture, its emissive factor is what it emits in W/(m² sr). What has no colour is
    white. A camera that was set in trimesh is taken; lights are not, because trimesh makes up some by itself.
    Point clouds and paths get a warning.

    Args:
        source: the scene or mesh.
        smooth: shade with trimesh's vertex normals; otherwise shading is flat. trimesh joins the vertices of
            hard edges too, where its normals are averages.
        name: the scene's name.
        lights: the scene's lights; without any, and where nothing else shines, one is placed.
        cameras: the scene's cameras, before one that was set in trimesh.
        environment: light from far away all around, such as an `even_sky`.

    Raises:
        InputError: it is neither, or an array breaks a rule of `scene_from_arrays`.

    Example:
        >>> scene_from_trimesh(trimesh.creation.box())
        Scene('trimesh', 12 triangles, 1 instance, 1 material)
    """

    def made() -> Scene:
        builder, warnings = ArraySceneBuilder(), Warnings()
        if hasattr(source, "geometry") and hasattr(source, "graph"):
            _add_nodes(builder, source, smooth, warnings)
            return builder.scene(name, lights, (*cameras, *_own_camera(source)), warnings, environment)
        if not _is_mesh(source):
            raise SceneFileError(
                f"source: must be a trimesh.Scene or trimesh.Trimesh, got {type(source).__name__}"
            )
        mesh = _add_mesh(builder, name, source, smooth)
        if mesh is not None:
            builder.place(name, mesh, np.eye(4))
        return builder.scene(name, lights, cameras, warnings, environment)

    return read_at_border("scene_from_trimesh", made)


def _is_mesh(geometry: Any) -> bool:
    return hasattr(geometry, "vertices") and hasattr(geometry, "faces")


def _add_nodes(builder: ArraySceneBuilder, source: Any, smooth: bool, warnings: Warnings) -> None:
    added: dict[str, int | None] = {}
    for node in source.graph.nodes_geometry:
        to_world, name = source.graph[node]
        geometry = source.geometry[name]
        if not _is_mesh(geometry):
            warnings.add(f"geometry {name!r:.60} is a {type(geometry).__name__}, no mesh; it is ignored")
            continue
        if name not in added:
            added[name] = _add_mesh(builder, name, geometry, smooth)
        mesh = added[name]
        if mesh is not None:
            builder.place(str(node), mesh, to_world)


def _own_camera(source: Any) -> tuple[Camera, ...]:
    """The camera that was set in trimesh, which would make one up if it were asked for it."""
    if not source.has_camera:
        return ()
    # trimesh has degrees, across and upright; its cameras look along −Z with +Y up, as ours do.
    yfov = np.radians(source.camera.fov[1])
    return (Camera(source.camera_transform, float(yfov), name=str(source.camera.name)),)


def _add_mesh(builder: ArraySceneBuilder, name: str, mesh: Any, smooth: bool) -> int | None:
    normals = np.asarray(mesh.vertex_normals) if smooth else None
    colours = _colours(mesh.visual)
    try:
        return builder.add_mesh(name, mesh.vertices, np.asarray(mesh.faces), normals=normals, **colours)
    except SceneFileError as error:
        raise SceneFileError(f"geometry {name!r:.60}: {error}") from error


def _colours(visual: Any) -> dict[str, Any]:
    """The colours of a mesh, as arguments of `ArraySceneBuilder.add_mesh`."""
    kind = getattr(visual, "kind", None)
    if kind == "vertex":
        return {"albedo": _linear(visual.vertex_colors)}
    if kind == "face":
        return {"triangle_albedo": _linear(visual.face_colors)}
    if kind != "texture" or visual.material is None:
        return {}
    material = visual.material
    if hasattr(material, "to_pbr"):
        material = material.to_pbr()
    colours: dict[str, Any] = {"emits_both_ways": bool(getattr(material, "doubleSided", None))}
    emissive = getattr(material, "emissiveFactor", None)
    if emissive is not None:
        colours["emission"] = np.asarray(emissive)[:3]
    factor = getattr(material, "baseColorFactor", None)
    if factor is not None and tuple(factor[:3]) != _NO_COLOR:
        colours["albedo"] = np.asarray(factor[:3]) / 255.0
    image = getattr(material, "baseColorTexture", None)
    if image is not None and visual.uv is not None:
        # v points up in trimesh.
        colours["uv"] = np.asarray(visual.uv)[:, :2] * (1.0, -1.0) + (0.0, 1.0)
        colours["texture"] = np.asarray(image.convert("RGB"))
    return colours


def _linear(colors: Any) -> Float32[np.ndarray, "rows 3"]:
    """trimesh's RGBA bytes as linear RGB."""
    return linear_from_srgb(np.asarray(colors)[:, :3].astype(np.float32) / np.float32(255.0))
