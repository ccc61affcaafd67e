"""A scene on the GPU: one vertex buffer, one index buffer, one indirect draw for each texture."""

import math
from dataclasses import dataclass

import moderngl
import numpy as np
from jaxtyping import Float64

from vpltune.renderer.gpu.gpu_context import GL_SRGB8, GL_SRGB8_ALPHA8, check_errors
from vpltune.renderer.gpu.gpu_program import RasterProgram
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.shader_library import set_uniforms
from vpltune.renderer.scene.animation import AnimationPlayer
from vpltune.renderer.scene.placed_boxes import placed_boxes
from vpltune.renderer.scene.scene import Material, Mesh, Scene, Texture

_VERTEX_LAYOUT = "3f 3f 2f 3f"
_VERTEX_ATTRIBUTES = ("in_position", "in_normal", "in_uv", "in_color")
_INSTANCE_DTYPE = np.dtype(
    [
        ("to_world", "f4", (4, 4)),
        ("normal_to_world", "f4", (4, 4)),
        ("base_color", "f4", 4),
        ("skinning", "i4", 4),
        ("alpha", "f4", 4),
        ("emission", "f4", 4),
    ]
)
_INFLUENCE_DTYPE = np.dtype([("joint", "i4"), ("weight", "f4")])
_COMMAND_DTYPE = np.dtype(
    [("count", "u4"), ("instances", "u4"), ("first", "u4"), ("base_vertex", "i4"), ("base_instance", "u4")]
)
_MAX_ANISOTROPY = 8.0
"""Samples of a texture along its longer direction. A choice."""

SCENE_READS = ("scene_instances", "skin_influences", "joint_matrices", "base_color_texture")
"""What a program declares that draws the scene; `emission_texture` too if it draws what surfaces emit."""


@dataclass(frozen=True)
class DrawGroup:
    """A run of indirect draw commands that share their textures, all opaque or all not."""

    texture: moderngl.Texture
    mirrored: tuple[int, int]
    emission_texture: moderngl.Texture
    emission_mirrored: tuple[int, int]
    first: int
    count: int
    is_opaque: bool


class SceneBuffers:
    """Vertex, index, instance and command buffers of one scene, and its textures.

    Where things stand may change between frames (`set_pose`); nothing is precomputed from it but the
    bounds.
    """

    def __init__(self, context: moderngl.Context, scene: Scene):
        self._context = context
        self._scene = scene
        self._boxes = placed_boxes(scene)
        self._vertices = context.buffer(
            np.concatenate([_interleaved(mesh) for mesh in scene.meshes]).tobytes()
        )
        self._indices = context.buffer(
            np.concatenate([mesh.triangles.ravel() for mesh in scene.meshes]).astype("u4").tobytes()
        )
        self._make_skinning()
        self._records = self._instance_records()
        self._instances = context.buffer(reserve=self._records.nbytes)
        self._textures = [_upload_texture(context, texture) for texture in scene.textures]
        self._environment = None
        if scene.environment is not None:
            radiance = scene.environment.radiance
            size = (radiance.shape[1], radiance.shape[0])
            self._environment = context.texture(size, 3, radiance.tobytes(), dtype="f4")
        self._white = context.texture((1, 1), 3, b"\xff\xff\xff", alignment=1)
        self.draw_groups = self._make_commands()
        # gl_InstanceID ignores the base instance; a per-instance attribute does not.
        self._instance_numbers = context.buffer(np.arange(len(scene.instances), dtype="i4").tobytes())
        rest = AnimationPlayer(scene).rest_pose()
        self.set_pose(rest.transforms, rest.joint_matrices)
        self.rest_bounds = self._bounds
        """As `bounds`, of the scene at rest."""
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

    @property
    def has_holes(self) -> bool:
        """Whether a surface is not opaque."""
        return not all(group.is_opaque for group in self.draw_groups)

    @property
    def has_blended(self) -> bool:
        """Whether a surface lets a share of the light pass."""
        return any(self._scene.materials[mesh.material].is_blended for mesh in self._scene.meshes)

    @property
    def glows(self) -> bool:
        """Whether a surface emits light of its own."""
        return any(self._scene.materials[mesh.material].glows for mesh in self._scene.meshes)

    def draw(self, program: RasterProgram, vertex_array: moderngl.VertexArray, *, opaque: bool) -> None:
        """Draw all opaque instances, or all others, with a program that is bound.

        Takes one multi-draw for each pair of textures.
        """
        unit = program.unit("base_color_texture")
        emission_unit = program.unit("emission_texture") if program.reads("emission_texture") else None
        for group in self.draw_groups:
            if group.is_opaque != opaque:
                continue
            group.texture.use(unit)
            set_uniforms(program.program, mirrored=group.mirrored)
            if emission_unit is not None:
                group.emission_texture.use(emission_unit)
                set_uniforms(program.program, emission_mirrored=group.emission_mirrored)
            vertex_array.render_indirect(self._commands, moderngl.TRIANGLES, group.count, group.first)

    def resources(self) -> Resources:
        """The buffers that `shaders/common/scene_vertex.glsl` reads, and a texture for those without one."""
        resources = Resources(self._context)
        resources["scene_instances"] = self._instances
        resources["skin_influences"] = self._influences
        resources["joint_matrices"] = self._joints
        if self._environment is not None:
            resources["environment_map"] = self._environment
        resources["base_color_texture"] = resources["emission_texture"] = self._white
        return resources

    def set_pose(
        self,
        transforms: Float64[np.ndarray, "instances 4 4"],
        joint_matrices: Float64[np.ndarray, "joints 4 4"],
    ) -> None:
        """Move everything; takes effect with the next frame. One write for each of the two buffers.

        Args:
            transforms: to world, of all instances; those that joints place do not use theirs.
            joint_matrices: of all skins, one after the other.
        """
        self._bounds = self._boxes.bounds(transforms, joint_matrices)
        self.transforms, self.joint_matrices = transforms, joint_matrices
        # GLSL matrices are stored column by column.
        self._records["to_world"] = transforms.transpose(0, 2, 1)
        self._records["normal_to_world"][:, :3, :3] = _normal_matrices(transforms).transpose(0, 2, 1)
        self._instances.write(self._records)
        if len(joint_matrices):
            self._joints.write(np.ascontiguousarray(joint_matrices.transpose(0, 2, 1), np.float32))

    def bounds(self) -> Float64[np.ndarray, "2 3"]:
        """Low and high corner of a box around all instances as they stand, world units."""
        return self._bounds

    def _make_commands(self) -> list[DrawGroup]:
        scene = self._scene
        vertex_starts = np.cumsum([0] + [len(mesh.positions) for mesh in scene.meshes])
        index_starts = np.cumsum([0] + [mesh.triangles.size for mesh in scene.meshes])
        materials = [scene.materials[scene.meshes[i.mesh].material] for i in scene.instances]
        # Opaque instances come first; of those, the ones without a texture.
        kinds = [
            (
                not m.is_opaque,
                m.texture is not None,
                m.texture or 0,
                -1 if m.emission_texture is None else m.emission_texture,
            )
            for m in materials
        ]
        order = sorted(range(len(kinds)), key=kinds.__getitem__)
        commands = np.zeros(len(order), _COMMAND_DTYPE)
        groups: list[DrawGroup] = []
        for position, i in enumerate(order):
            mesh = scene.instances[i].mesh
            commands[position] = (
                scene.meshes[mesh].triangles.size, 1, index_starts[mesh], vertex_starts[mesh], i
            )  # fmt: skip
            if position == 0 or kinds[i] != kinds[order[position - 1]]:
                groups.append(self._group(materials[i], position, kinds.count(kinds[i])))
        self._commands = self._context.buffer(commands.tobytes())
        return groups

    def _group(self, material: Material, first: int, count: int) -> DrawGroup:
        colors = self._texture(material.texture)
        return DrawGroup(*colors, *self._texture(material.emission_texture), first, count, material.is_opaque)

    def _texture(self, index: int | None) -> tuple[moderngl.Texture, tuple[int, int]]:
        """A texture of the scene, or white for none; and 1 for each axis that repeats mirrored."""
        if index is None:
            return self._white, (0, 0)
        source = self._scene.textures[index]
        mirrored = (int(source.wrap_u == "mirrored_repeat"), int(source.wrap_v == "mirrored_repeat"))
        return self._textures[index], mirrored

    def _instance_records(self) -> np.ndarray:
        """Everything about instances but where they are."""
        scene = self._scene
        records = np.zeros(len(scene.instances), _INSTANCE_DTYPE)
        vertex_starts = np.cumsum([0] + [len(mesh.positions) for mesh in scene.meshes])
        for index, instance in enumerate(scene.instances):
            mesh = scene.meshes[instance.mesh]
            material = scene.materials[mesh.material]
            records["base_color"][index, :3] = material.base_color
            records["alpha"][index] = material.opacity, material.alpha_cutoff, material.is_blended, index
            records["emission"][index] = *material.emission, material.emits_both_ways
            if mesh.skinning is not None and scene.animation is not None:
                records["skinning"][index] = (
                    self._first_influences[instance.mesh],
                    vertex_starts[instance.mesh],
                    mesh.skinning.joints.shape[1],
                    self._first_joints[scene.animation.instance_skins[index]],
                )
        return records

    def _make_skinning(self) -> None:
        """The influences of all skinned vertices, mesh after mesh, and room for all joints."""
        scene = self._scene
        skins = () if scene.animation is None else scene.animation.skins
        self._first_joints = np.cumsum([0] + [len(skin.joints) for skin in skins])
        bent = [mesh.skinning for mesh in scene.meshes]
        counts = [0 if skinning is None else skinning.joints.size for skinning in bent]
        self._first_influences = np.cumsum([0, *counts])
        # OpenGL buffers cannot be empty.
        influences = np.zeros(max(1, sum(counts)), _INFLUENCE_DTYPE)
        for start, count, skinning in zip(self._first_influences, counts, bent, strict=False):
            if skinning is not None:
                influences["joint"][start : start + count] = skinning.joints.ravel()
                influences["weight"][start : start + count] = skinning.weights.ravel()
        self._influences = self._context.buffer(influences)
        self._joints = self._context.buffer(reserve=64 * max(1, int(self._first_joints[-1])))


def _normal_matrices(transforms: Float64[np.ndarray, "n 4 4"]) -> Float64[np.ndarray, "n 3 3"]:
    """Cofactors of the linear parts, at a size that float32 can hold: normals need only the direction."""
    linear = transforms[:, :3, :3]
    cofactors = np.stack([np.cross(linear[:, (i + 1) % 3], linear[:, (i + 2) % 3]) for i in range(3)], axis=1)
    size = np.abs(cofactors).max(axis=(1, 2), keepdims=True)
    return np.divide(cofactors, size, out=np.zeros_like(cofactors), where=size > 0.0)


def _bytes(part: str) -> int:
    return int(part[:-1]) * 4


def _interleaved(mesh: Mesh) -> np.ndarray:
    positions, normals = mesh.positions, mesh.normals
    if mesh.skinning is not None:
        positions, normals = mesh.skinning.bind_positions, mesh.skinning.bind_normals
    return np.ascontiguousarray(
        np.concatenate([positions, normals, mesh.uv, mesh.colors], axis=1), np.float32
    )


def _upload_texture(context: moderngl.Context, texture: Texture) -> moderngl.Texture:
    height, width, _ = texture.texels_srgb.shape
    texels, internal_format = texture.texels_srgb, GL_SRGB8
    if texture.opacity is not None:
        texels = np.concatenate([texels, texture.opacity[..., None]], axis=2)
        internal_format = GL_SRGB8_ALPHA8
    # Row 0 of the upload is v = 0, and glTF's v = 0 is the top row: no flip.
    data = np.ascontiguousarray(texels).tobytes()
    uploaded = context.texture(
        (width, height), texels.shape[2], data, alignment=1, internal_format=internal_format
    )
    uploaded.build_mipmaps(0, max(0, math.floor(math.log2(max(width, height)))))
    uploaded.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    uploaded.anisotropy = _MAX_ANISOTROPY
    uploaded.repeat_x = texture.wrap_u == "repeat"
    uploaded.repeat_y = texture.wrap_v == "repeat"
    return uploaded
