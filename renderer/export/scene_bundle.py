"""One view of a scene with its tuned config, as plain numbers that any program can read: JSON and one .bin.

Everything that the runtime draws from is there, and nothing that it draws: triangles in world space, texels,
camera, lights and the faces of their reflective shadow maps, the config. `examples/standalone_reader.py`
draws the image from it without this package; the page of `vpltune export --to web` carries one inside.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vpltune.renderer.config.tuned_config import TunedConfig, config_text
from vpltune.renderer.files.atomic_file import write_text_whole, written_together, written_whole
from vpltune.renderer.frame import vpl_disc_bounds
from vpltune.renderer.frame.disc_samples import NORMAL_REACH, OFF_PLANE_FACTOR, SAMPLE_REACH, sample_count
from vpltune.renderer.frame.passes import vpl_importance
from vpltune.renderer.frame.passes.tone_mapping import EXPOSURE_KEY
from vpltune.renderer.frame.point_table import R2_STEPS
from vpltune.renderer.frame.rsm_resolution import rsm_resolution
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.frame.visibility_map_layout import VisibilityMapLayout
from vpltune.renderer.gpu.camera_uniforms import camera_uniforms
from vpltune.renderer.gpu.render_targets import atlas_columns
from vpltune.renderer.scene.animation import AnimationPlayer
from vpltune.renderer.scene.light_faces import LightRecords, face_count, light_records
from vpltune.renderer.scene.panes import is_pane
from vpltune.renderer.scene.placed_boxes import placed_boxes
from vpltune.renderer.scene.scene import Scene, Texture
from vpltune.renderer.scene.sun_faces import SunGrid, nested_face_count
from vpltune.renderer.scene.transforms import transform_normals, transform_points
from vpltune.renderer.scene.views import View, light_to_json

FORMAT = "vpltune-bundle"
VERSION = 3
"""Version of the bundle that is written. Since 2 its `config` is of version 2; since 3 a sun may have several
faces, each within the one before, importance mixes, and a light may have a range."""
# What triangles without a texture look up.
WHITE = Texture("white", np.full((1, 1, 3), 255, np.uint8))
# A choice: materials that a sentence of `left_out` names.
_NAMES_SHOWN = 5
DOCUMENT_NAME, BINARY_NAME = "bundle.json", "bundle.bin"


@dataclass(frozen=True)
class SceneBundle:
    """The document, and the bytes that its offsets count in."""

    document: dict[str, Any]
    binary: bytes

    @property
    def left_out(self) -> tuple[str, ...]:
        """What of the config and the scene is not drawn outside the runtime, a sentence each."""
        return tuple(self.document["left_out"])


def scene_bundle(scene: Scene, view: View, config: TunedConfig) -> SceneBundle:
    """The bundle of a scene at rest, for the runtime with its default options.

    Raises:
        InputError: the config holds a value that is out of range.
    """
    rest = AnimationPlayer(scene).rest_pose()
    bounds = placed_boxes(scene).bounds(rest.transforms, rest.joint_matrices)
    binary = _Binary()
    draws = _draws(scene, binary)
    resolution = rsm_resolution(view.lights, config.quality)
    x, y, z = view.camera.position_world.tolist()
    length = float(np.linalg.norm(bounds[1] - bounds[0]))
    grid = SunGrid(resolution, (x, y, z), nested_face_count(scene), length)
    records = light_records(view.lights, bounds, grid)
    _add_light_records(view, records, resolution, binary)
    columns, rows = _atlas(records)
    uniforms = camera_uniforms(view.camera, view.size, bounds)
    drawn_whole = tuple(material.name for material in scene.materials if not material.is_opaque)
    document = {
        "format": FORMAT,
        "version": VERSION,
        "scene": scene.name,
        "config": json.loads(config_text(config)),
        "left_out": list(left_out(config, view.size, drawn_whole, _other_light(scene))),
        "view": {
            "size": list(view.size),
            "camera_to_world": view.camera.to_world.tolist(),
            "tan_half_fov": list(uniforms.tan_half_fov),
            "near_plane": uniforms.near_plane,
            "exposure_key": EXPOSURE_KEY,
        },
        "bounds": bounds.tolist(),
        "diagonal": length,
        "lights": [light_to_json(light) for light in view.lights],
        "rsm": {
            "resolution": resolution,
            "atlas": [resolution * rows, resolution * columns],
            "filtering": RuntimeOptions().rsm_filtering,
            "moment_origin": list(records.moment_origin),
            "faces": _faces(records, resolution),
        },
        "point_table": {"kind": "r2", "steps": list(R2_STEPS)},
        "vpl_importance": _vpl_importance(config, view),
        "clustered_discs": _clustered_discs(config),
        "visibility_maps": _visibility_maps(config),
        "draws": draws,
        "textures": [_texture(texture, binary) for texture in (*scene.textures, WHITE)],
        "arrays": binary.arrays,
    }
    return SceneBundle(document, bytes(binary.content))


def _other_light(scene: Scene) -> tuple[str, ...]:
    """Light of the scene that comes from no lamp."""
    glows = any(material.glows for material in scene.materials)
    sky = scene.environment is not None
    return (*(("glowing surfaces",) if glows else ()), *(("the sky",) if sky else ()))


def _vpl_importance(config: TunedConfig, view: View) -> dict[str, Any]:
    used = config.parameters.density_importance > 0.0
    return {
        "cells": vpl_importance.importance_cells(face_count(view.lights, nested_faces=0)) if used else 0,
        "receivers": vpl_importance.RECEIVERS,
        "spread": vpl_importance.SPREAD,
        "dark_share": vpl_importance.DARK_SHARE,
        "least": vpl_importance.LEAST_IMPORTANCE,
    }


def _clustered_discs(config: TunedConfig) -> dict[str, Any]:
    return {
        # 0: VPLs are points, and the rest says nothing.
        "steps": config.parameters.lloyd_iterations if config.parameters.vpls_are_discs else 0,
        "samples": sample_count(config.parameters.vpl_count),
        "normal_reach": NORMAL_REACH,
        "off_plane_factor": OFF_PLANE_FACTOR,
        "sample_reach": SAMPLE_REACH,
        "disc": {
            "least_part": vpl_disc_bounds.LEAST_PART,
            "least_radius": vpl_disc_bounds.LEAST_RADIUS,
            "fade_height": vpl_disc_bounds.FADE_HEIGHT,
            "facing_fade_height": vpl_disc_bounds.FACING_FADE_HEIGHT,
        },
    }


def _visibility_maps(config: TunedConfig) -> dict[str, int]:
    layout = VisibilityMapLayout.of(config)
    vpl_count = config.parameters.vpl_count
    blocks = layout.blocks(vpl_count)
    return {
        "map_size": layout.size,
        "map_refinement": layout.refinement,
        "map_blocks": blocks,
        "map_room": vpl_count * layout.size**2 + blocks * layout.refinement**2,
    }


def left_out(
    config: TunedConfig,
    frame_size: tuple[int, int],
    drawn_whole: tuple[str, ...] = (),
    other_light: tuple[str, ...] = (),
) -> tuple[str, ...]:
    """What of a config and its scene is not drawn outside the runtime, a sentence each.

    Args:
        config: what is drawn with.
        frame_size: in pixels.
        drawn_whole: names of the materials that are not opaque.
        other_light: what else than lamps lights the scene.
    """
    sentences = []
    later = () if config.light.bounces == 1 else ("light that is reflected more than once",)
    if later or other_light:
        *others, last = (*later, *(f"light of {each}" for each in other_light))
        missing = f"{', '.join(others)} and {last}" if others else last
        sentences.append(f"Only the first bounce of lamps is drawn here: {missing} is left out")
    if drawn_whole:
        names = ", ".join(drawn_whole[:_NAMES_SHOWN]) + (", …" if len(drawn_whole) > _NAMES_SHOWN else "")
        sentences.append(f"See-through surfaces are left out here, or drawn whole if half opaque ({names})")
    if config.parameters.screen_space_strength > 0.0 and not config.parameters.vpls_are_discs:
        sentences.append("The screen-space near field is drawn by the runtime alone")
    if config.quality.interleave_for(config.parameters.vpl_count, frame_size) > 1:
        sentences.append("Every pixel gathers every VPL here; only the runtime interleaves them")
    return tuple(sentences)


def write_bundle(folder: Path, bundle: SceneBundle) -> None:
    """Write `bundle.json` and `bundle.bin` into `folder`, both or neither.

    Raises:
        InputError: the folder is a file.
        MachineError: it cannot be written to.
    """
    with written_together(folder) as staging:
        with written_whole(staging / BINARY_NAME) as temporary:
            temporary.write_bytes(bundle.binary)
        text = json.dumps(bundle.document, indent=1, allow_nan=False) + "\n"
        write_text_whole(staging / DOCUMENT_NAME, text)


class _Binary:
    """Arrays one after another, each at a multiple of four bytes."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.arrays: dict[str, dict[str, Any]] = {}

    def add_array(self, name: str, values: np.ndarray) -> None:
        plain = np.ascontiguousarray(values, np.dtype(values.dtype).newbyteorder("<"))
        self.arrays[name] = {
            "type": values.dtype.name,
            "shape": list(values.shape),
            **self.add(plain.tobytes()),
        }

    def add(self, content: bytes) -> dict[str, int]:
        self.content.extend(bytes(-len(self.content) % 4))
        place = {"offset": len(self.content), "bytes": len(content)}
        self.content.extend(content)
        return place


def _draws(scene: Scene, binary: _Binary) -> list[dict[str, Any]]:
    """All triangles in world space but panes, those of one texture together; a draw is a run of them."""
    white = len(scene.textures)
    panes = [is_pane(scene, mesh) for mesh in scene.meshes]
    shown = [instance for instance in scene.instances if not panes[instance.mesh]] or scene.instances
    textures = [scene.materials[scene.meshes[i.mesh].material].texture for i in shown]
    textures = [white if texture is None else texture for texture in textures]
    order = sorted(range(len(textures)), key=lambda i: textures[i])
    parts: dict[str, list[np.ndarray]] = {name: [] for name in ("positions", "normals", "uv", "base_colors")}
    triangles, draws, first_vertex, first_triangle = [], [], 0, 0
    for index in order:
        instance = shown[index]
        mesh = scene.meshes[instance.mesh]
        parts["positions"].append(transform_points(instance.to_world, mesh.positions))
        parts["normals"].append(transform_normals(instance.to_world, mesh.normals))
        parts["uv"].append(mesh.uv)
        parts["base_colors"].append(mesh.colors * scene.materials[mesh.material].base_color)
        triangles.append(mesh.triangles + first_vertex)
        first_vertex += len(mesh.positions)
        if not draws or draws[-1]["texture"] != textures[index]:
            draws.append({"texture": textures[index], "first": first_triangle, "count": 0})
        draws[-1]["count"] += len(mesh.triangles)
        first_triangle += len(mesh.triangles)
    for name, arrays in parts.items():
        binary.add_array(name, np.concatenate(arrays).astype(np.float32))
    binary.add_array("triangles", np.concatenate(triangles).astype(np.uint32))
    return draws


def _add_light_records(view: View, records: LightRecords, resolution: int, binary: _Binary) -> None:
    """Lights and faces once more, as rows that a shader storage buffer takes as they are.

    A light: position, kind (0 spot, 1 point, 2 directional); direction, 1/(cos inner − cos outer); intensity,
    cos outer; 1/range, 0, 0, 0. A face: world to face, column by column; extent, number of its light, 1 where
    orthographic; column and row of its tile in the atlas, near plane or range, 0.
    """
    lights = np.zeros((len(view.lights), 4, 4), np.float32)
    for row, name in enumerate(("position_kind", "direction_cone_scale", "intensity_cos_outer")):
        lights[:, row] = records.lights[name]
    lights[:, 3, 0] = records.lights["inverse_range"]
    binary.add_array("lights", lights)
    faces = np.zeros((len(records.faces), 6, 4), np.float32)
    for row, face, place in zip(faces, records.faces, _faces(records, resolution), strict=True):
        # Transposed twice: the record has the matrix column by column, and its inverse must be so too.
        row[:4] = np.linalg.inv(face["light_to_world"].astype(np.float64))
        row[4] = *face["extent"], face["light"], face["orthographic"]
        row[5] = *reversed(place["origin"]), face["near_or_range"], 0.0
    binary.add_array("faces", faces)


def _texture(texture: Texture, binary: _Binary) -> dict[str, Any]:
    """Texels as red, green and blue bytes, sRGB-encoded, top row first; their v counts from there."""
    height, width, _ = texture.texels_srgb.shape
    wraps = (texture.wrap_u, texture.wrap_v)
    return {
        "name": texture.name,
        "size": [width, height],
        "repeat": [wrap == "repeat" for wrap in wraps],
        "mirrored": [int(wrap == "mirrored_repeat") for wrap in wraps],
        **binary.add(np.ascontiguousarray(texture.texels_srgb).tobytes()),
    }


def _atlas(records: LightRecords) -> tuple[int, int]:
    """Columns and rows of tiles."""
    columns = atlas_columns(len(records.faces))
    return columns, max(1, -(-len(records.faces) // columns))


def _faces(records: LightRecords, resolution: int) -> list[dict[str, Any]]:
    columns, _ = _atlas(records)
    return [
        {
            "light": int(face["light"]),
            # GLSL's matrices are stored column by column.
            "light_to_world": face["light_to_world"].T.tolist(),
            "extent": face["extent"].tolist(),
            "near_or_range": float(face["near_or_range"]),
            "orthographic": bool(face["orthographic"]),
            "origin": [index // columns * resolution, index % columns * resolution],
        }
        for index, face in enumerate(records.faces)
    ]
