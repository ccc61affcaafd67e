"""A scene on the GPU: one vertex buffer, one index buffer, one indirect draw for each texture."""

import math
from dataclasses import dataclass

import moderngl
import numpy as np
from jaxtyping import Float64

from renderer import buffer_bindings
from renderer.gpu_context import GL_SRGB8, check_errors
from renderer.scene import Mesh, Scene, Texture

_VERTEX_LAYOUT = "3f 3f 2f 3f"
_VERTEX_ATTRIBUTES = ("in_position", "in_normal", "in_uv", "in_color")
_INSTANCE_DTYPE = np.dtype(
    [("to_world", "f4", (4, 4)), ("normal_to_world", "f4", (4, 4)), ("base_color", "f4", 4)]
)
_COMMAND_DTYPE = np.dtype(
    [("count", "u4"), ("instances", "u4"), ("first", "u4"), ("base_vertex", "i4"), ("base_instance", "u4")]
)
_MAX_ANISOTROPY = 8.0


@dataclass(frozen=True)
class DrawGroup:
    """A run of indirect draw commands that share one texture."""

    texture: moderngl.Texture
    mirrored: tuple[int, int]
    first: int
    count: int


class SceneBuffers:
    """Vertex, index, instance and command buffers of one scene, and its textures.

    An instance's transform may change between frames (`set_transform`); nothing else is precomputed
    from it but the bounds.
    """

    def __init__(self, context: moderngl.Context, scene: Scene):
        self._context = context
        self._scene = scene
        self._transforms = np.array([instance.to_world for instance in scene.instances])
        self._local_bounds = np.array(
            [
                [scene.meshes[i.mesh].positions.min(axis=0), scene.meshes[i.mesh].positions.max(axis=0)]
                for i in scene.instances
            ],
            np.float64,
        )
        self._vertices = context.buffer(
            np.concatenate([_interleaved(mesh) for mesh in scene.meshes]).tobytes()
        )
        self._indices = context.buffer(
            np.concatenate([mesh.triangles.ravel() for mesh in scene.meshes]).astype("u4").tobytes()
        )
        self._instances = context.buffer(reserve=_INSTANCE_DTYPE.itemsize * len(scene.instances))
        self._textures = [_upload_texture(context, texture) for texture in scene.textures]
        self._white = context.texture((1, 1), 3, b"\xff\xff\xff")
        self.draw_groups = self._make_commands()
        # gl_InstanceID ignores the base instance; a per-instance attribute does not.
        self._instance_numbers = context.buffer(np.arange(len(scene.instances), dtype="i4").tobytes())
        self._upload_instances()
        check_errors(context, f"the buffers of scene {scene.name}")

    def vertex_array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """The scene's vertices bound to a program's inputs; inputs that it does not use are skipped."""
        attributes = [name if name in program else None for name in _VERTEX_ATTRIBUTES]
        layout = " ".join(
            part if name else f"{_bytes(part)}x"
            for part, name in zip(_VERTEX_LAYOUT.split(), attributes, strict=True)
        )
        content = [
            (self._vertices, layout, *(name for name in attributes if name)),
            (self._instance_numbers, "1i /i", "in_instance"),
        ]
        return self._context.vertex_array(program, content, index_buffer=self._indices, index_element_size=4)

    def draw(self, vertex_array: moderngl.VertexArray, texture_unit: int = 0) -> None:
        """Draw every instance: one multi-draw for each texture."""
        self._instances.bind_to_storage_buffer(buffer_bindings.SCENE_INSTANCES)
        program = vertex_array.program
        for group in self.draw_groups:
            group.texture.use(texture_unit)
            if "mirrored" in program:
                program["mirrored"] = group.mirrored
            vertex_array.render_indirect(self._commands, moderngl.TRIANGLES, group.count, group.first)

    def set_transform(self, instance: int, to_world: Float64[np.ndarray, "4 4"]) -> None:
        """Move one instance; takes effect with the next frame."""
        self._transforms[instance] = to_world
        self._upload_instances()

    def bounds(self) -> Float64[np.ndarray, "2 3"]:
        """Low and high corner of a box around all instances as they stand, world units."""
        return self._bounds

    def _placed_bounds(self) -> Float64[np.ndarray, "2 3"]:
        selector = np.array([[(corner >> axis) & 1 for axis in range(3)] for corner in range(8)])
        corners = self._local_bounds[:, selector, np.arange(3)]
        placed = corners @ self._transforms[:, :3, :3].transpose(0, 2, 1) + self._transforms[:, None, :3, 3]
        return np.stack([placed.min(axis=(0, 1)), placed.max(axis=(0, 1))])

    def _make_commands(self) -> list[DrawGroup]:
        scene = self._scene
        vertex_starts = np.cumsum([0] + [len(mesh.positions) for mesh in scene.meshes])
        index_starts = np.cumsum([0] + [mesh.triangles.size for mesh in scene.meshes])
        texture_of = [scene.materials[scene.meshes[i.mesh].material].texture for i in scene.instances]
        order = sorted(
            range(len(scene.instances)), key=lambda i: -1 if texture_of[i] is None else texture_of[i]
        )
        commands = np.zeros(len(order), _COMMAND_DTYPE)
        groups: list[DrawGroup] = []
        for position, i in enumerate(order):
            mesh = scene.instances[i].mesh
            commands[position] = (
                scene.meshes[mesh].triangles.size, 1, index_starts[mesh], vertex_starts[mesh], i
            )  # fmt: skip
            if position == 0 or texture_of[i] != texture_of[order[position - 1]]:
                groups.append(self._group(texture_of[i], position, order, texture_of))
        self._commands = self._context.buffer(commands.tobytes())
        return groups

    def _group(
        self, texture: int | None, first: int, order: list[int], texture_of: list[int | None]
    ) -> DrawGroup:
        count = sum(texture_of[i] == texture for i in order)
        if texture is None:
            return DrawGroup(self._white, (0, 0), first, count)
        source = self._scene.textures[texture]
        mirrored = (int(source.wrap_u == "mirrored_repeat"), int(source.wrap_v == "mirrored_repeat"))
        return DrawGroup(self._textures[texture], mirrored, first, count)

    def _upload_instances(self) -> None:
        self._bounds = self._placed_bounds()
        records = np.zeros(len(self._transforms), _INSTANCE_DTYPE)
        # GLSL matrices are stored column by column.
        records["to_world"] = self._transforms.transpose(0, 2, 1)
        linear = self._transforms[:, :3, :3]
        # Normals need the direction of the cofactors only; dividing by their size keeps float32 in range.
        cofactors = np.stack(
            [np.cross(linear[:, (i + 1) % 3], linear[:, (i + 2) % 3]) for i in range(3)], axis=1
        )
        size = np.abs(cofactors).max(axis=(1, 2), keepdims=True)
        cofactors = np.divide(cofactors, size, out=np.zeros_like(cofactors), where=size > 0.0)
        records["normal_to_world"][:, :3, :3] = cofactors.transpose(0, 2, 1)
        for index, instance in enumerate(self._scene.instances):
            material = self._scene.materials[self._scene.meshes[instance.mesh].material]
            records["base_color"][index, :3] = material.base_color
        self._instances.write(records.tobytes())


def _bytes(part: str) -> int:
    return int(part[:-1]) * 4


def _interleaved(mesh: Mesh) -> np.ndarray:
    return np.ascontiguousarray(
        np.concatenate([mesh.positions, mesh.normals, mesh.uv, mesh.colors], axis=1), np.float32
    )


def _upload_texture(context: moderngl.Context, texture: Texture) -> moderngl.Texture:
    height, width, _ = texture.texels_srgb.shape
    # Row 0 of the upload is v = 0, and glTF's v = 0 is the top row: no flip.
    data = np.ascontiguousarray(texture.texels_srgb).tobytes()
    uploaded = context.texture((width, height), 3, data, alignment=1, internal_format=GL_SRGB8)
    uploaded.build_mipmaps(0, max(0, math.floor(math.log2(max(width, height)))))
    uploaded.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    uploaded.anisotropy = _MAX_ANISOTROPY
    uploaded.repeat_x = texture.wrap_u == "repeat"
    uploaded.repeat_y = texture.wrap_v == "repeat"
    return uploaded
