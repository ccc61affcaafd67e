"""The triangles of glowing surfaces, for light to be drawn from them."""

import moderngl
import numpy as np
from jaxtyping import Float64

from vpltune.renderer.gpu.gpu_context import check_errors
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.rigid_pieces import RigidPiece, rigid_pieces
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.scene.scene import Material, Scene
from vpltune.renderer.scene.triangle_texels import equal_pieces, mean_stopped_texels

GLOWING_READS = ("glowing_triangles", "glowing_places")
"""What a program declares that includes `common/glowing_triangles.glsl`."""
MOST_PIECES = 16
"""A glowing triangle with a texture is cut into the square of this many, each with its mean radiance. A
choice."""
MOST_TRIANGLES = 1 << 18
"""Triangles after cutting; with more, they are cut into fewer. A choice: 16 MiB."""

_TRIANGLE_DTYPE = np.dtype([(corner, "f4", 4) for corner in "abc"] + [("place", "i4"), ("sides", "i4", 3)])


class GlowingTriangles:
    """The buffers behind `shaders/common/glowing_triangles.glsl`. Takes 64 bytes for each triangle.

    A skinned mesh glows as rigid pieces, as rays meet it (`renderer.gpu.rigid_pieces`).

    Raises:
        MachineError: the GPU ran out of memory.
    """

    count: int
    """Triangles, each placed instance's own."""

    def __init__(self, context: moderngl.Context, scene: Scene, scene_buffers: SceneBuffers):
        self._scene_buffers = scene_buffers
        pieces = [
            piece for piece in rigid_pieces(scene) if scene.materials[scene.meshes[piece.mesh].material].glows
        ]
        whole = sum(len(piece.triangles) for piece in pieces)
        cuts = int(np.clip(np.sqrt(MOST_TRIANGLES / max(1, whole)), 1, MOST_PIECES))
        parts = [_records(scene, piece, place, cuts) for place, piece in enumerate(pieces)]
        records = np.concatenate([np.zeros(0, _TRIANGLE_DTYPE), *parts])
        self.count = len(records)
        self._rows = np.array([piece.matrix_row for piece in pieces], np.int64)
        self._triangles = context.buffer(records if self.count else np.zeros(1, _TRIANGLE_DTYPE))
        self._places = context.buffer(reserve=48 * max(1, len(pieces)))
        self._placed: np.ndarray | None = None
        check_errors(context, f"the glowing surfaces of scene {scene.name}")

    def update(self) -> None:
        """Follow the scene buffers' pose: one write if anything has moved, else none."""
        buffers = self._scene_buffers
        to_world = np.concatenate([buffers.transforms, buffers.joint_matrices])[self._rows]
        if len(to_world) and (self._placed is None or not np.array_equal(to_world, self._placed)):
            self._placed = to_world
            self._places.write(np.ascontiguousarray(to_world[:, :3], np.float32))

    def add_to(self, resources: Resources) -> None:
        """Make these the triangles that programs with `GLOWING_READS` see."""
        resources["glowing_triangles"] = self._triangles
        resources["glowing_places"] = self._places


def _records(scene: Scene, piece: RigidPiece, place: int, cuts: int) -> np.ndarray:
    mesh = scene.meshes[piece.mesh]
    material = scene.materials[mesh.material]
    corners = piece.corners.astype(np.float64)
    uv = mesh.uv[mesh.triangles[piece.triangles]].astype(np.float64)
    has_holes = material.texture is not None and not material.is_opaque
    if cuts > 1 and (material.emission_texture is not None or has_holes):
        weights = equal_pieces(cuts)
        corners = np.einsum("kvw,twa->tkva", weights, corners).reshape(-1, 3, 3)
        uv = np.einsum("kvw,twa->tkva", weights, uv).reshape(-1, 3, 2)
    radiance = _radiance(scene, material, uv)
    records = np.zeros(len(corners), _TRIANGLE_DTYPE)
    for corner, name in enumerate("abc"):
        records[name][:, :3] = corners[:, corner]
        records[name][:, 3] = radiance[:, corner]
    records["place"] = place
    records["sides"][:, 0] = 2 if material.emits_both_ways else 1
    return records[radiance.any(axis=1)]


def _radiance(
    scene: Scene, material: Material, uv: Float64[np.ndarray, "triangles 3 2"]
) -> Float64[np.ndarray, "triangles 3"]:
    """The mean radiance of each triangle in W/(m² sr): a hole emits nothing, and a see-through surface by the
    share of the light that it stops."""
    emission = np.array(material.emission)
    if material.emission_texture is None and material.is_opaque:
        return np.broadcast_to(emission, (len(uv), 3))
    glow, base = (
        None if index is None else scene.textures[index]
        for index in (material.emission_texture, material.texture)
    )
    return emission * mean_stopped_texels(glow, uv, material, base)
