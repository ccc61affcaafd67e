"""Conversion of a glTF document to a scene: the meshes, lights and cameras of the active scene's nodes."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings, label
from vpltune.renderer.scene.files.gltf_accessors import GltfAccessors
from vpltune.renderer.scene.files.gltf_animations import Placed, placed_animation, read_channels
from vpltune.renderer.scene.files.gltf_deformation import Deformation, GltfDeformations, RestSkin
from vpltune.renderer.scene.files.gltf_document import GltfDocument, open_gltf
from vpltune.renderer.scene.files.gltf_lights_cameras import read_camera, read_light
from vpltune.renderer.scene.files.gltf_materials import GltfMaterials
from vpltune.renderer.scene.files.gltf_nodes import GltfNodes
from vpltune.renderer.scene.files.gltf_primitives import GltfPrimitives
from vpltune.renderer.scene.files.json_object import JsonObject, JsonObjects
from vpltune.renderer.scene.files.limited_decoder import LimitedDecoder
from vpltune.renderer.scene.files.limits import MAX_CAMERAS, MAX_INSTANCES, MAX_LIGHTS
from vpltune.renderer.scene.files.surface import turned
from vpltune.renderer.scene.scene import Camera, Instance, Light, Mesh, Scene
from vpltune.renderer.scene.transforms import trs_matrices


def read_gltf(path: Path, warnings: Warnings) -> Scene:
    """Read a .gltf or .glb file.

    Args:
        path: the file.
        warnings: takes a line for each thing that is ignored or approximated.

    Raises:
        SceneFileError: the file breaks a rule of glTF 2.0 that matters for the image, or exceeds a limit in
            `renderer.scene.files.limits`.
    """
    document = open_gltf(path, warnings)
    with LimitedDecoder("draco") as draco, LimitedDecoder("ktx2") as ktx2:
        builder = _SceneBuilder(document, draco, ktx2)
        shown = list(builder.nodes.shown())
        builder.look_for_lit_surfaces(shown)
        for index in shown:
            builder.add_node(index)
    return Scene(
        name=label(path.stem, "scene"),
        meshes=tuple(builder.meshes),
        instances=tuple(builder.instances),
        materials=tuple(builder.materials.materials),
        textures=tuple(builder.materials.textures),
        lights=tuple(builder.lights),
        cameras=tuple(builder.cameras),
        animation=placed_animation(builder.channels, builder.placed, builder.nodes),
        warnings=warnings.lines(),
    )


class _SceneBuilder:
    def __init__(self, document: GltfDocument, draco: LimitedDecoder, ktx2: LimitedDecoder) -> None:
        self.document = document
        self.nodes = GltfNodes(document)
        self.accessors = GltfAccessors(document)
        self.materials = GltfMaterials(document, self.accessors, ktx2)
        self.primitives = GltfPrimitives(document, self.accessors, draco)
        self.meshes: list[Mesh] = []
        self.instances: list[Instance] = []
        self.lights: list[Light] = []
        self.cameras: list[Camera] = []
        self.channels = read_channels(document, self.nodes, self.accessors)
        self.placed = Placed()
        moving = self.nodes.with_descendants({channel.node for channel in self.channels})
        self.deformations = GltfDeformations(document, self.nodes, self.accessors, moving)
        self._has_lit = False
        self._surfaces: dict[str, list[JsonObject]] = {}
        self._skins: dict[RestSkin, int] = {}
        self._meshes_at_rest: dict[tuple[str, Deformation], int | None] = {}
        self._turned: dict[int, int] = {}
        self._counts: Counter[str] = Counter()

    def look_for_lit_surfaces(self, shown: list[int]) -> None:
        """See whether anything is there for light to fall on; if not, unlit surfaces are lit."""
        meshes = [self.document.referred(self.nodes.nodes[i], "mesh", "meshes") for i in shown]
        placed = {mesh.where: mesh for mesh in meshes if mesh is not None}
        primitives = (primitive for mesh in placed.values() for primitive in mesh.objects("primitives"))
        self._has_lit = any(not self.materials.is_unlit(primitive) for primitive in primitives)

    def add_node(self, index: int) -> None:
        node = self.nodes.nodes[index]
        mesh = self.document.referred(node, "mesh", "meshes")
        camera = self.document.referred(node, "camera", "cameras")
        light = self._light_of(node)
        if mesh is not None:
            self._add_mesh(index, node, mesh)
        if camera is not None:
            self._count(1, "cameras", MAX_CAMERAS)
            filming = read_camera(camera, self.nodes.to_world(index), self.document)
            if filming is not None:
                name = camera.string("name", "") or node.string("name", "")
                self.cameras.append(replace(filming, name=label(name, "")))
                self.placed.camera_nodes.append(index)
        if light is not None:
            self._count(1, "lights", MAX_LIGHTS)
            shining = read_light(light, self.nodes.to_world(index), self.document)
            if shining is not None:
                self.lights.append(shining)
                self.placed.light_nodes.append(index)

    def _count(self, added: int, what: str, most: int) -> None:
        # What a node places counts even if nothing of it is drawn: it takes its time all the same.
        self._counts[what] += added
        if self._counts[what] > most:
            raise SceneFileError(f"nodes: must place at most {most:,} {what} in all")

    def _light_of(self, node: JsonObject) -> JsonObject | None:
        reference = node.extension("KHR_lights_punctual")
        if reference is None:
            return None
        extension = self.document.root.extension("KHR_lights_punctual")
        lights = JsonObjects([], "") if extension is None else extension.objects("lights")
        return lights[reference.required_index("light", len(lights), "lights")]

    def _add_mesh(self, index: int, node: JsonObject, mesh: JsonObject) -> None:
        primitives = self._surfaces_of(mesh)
        if not primitives:
            return
        deformation = self.deformations.of(node, mesh)
        # Only joints place a skinned mesh; its node's transform is ignored (glTF 2.0 section 3.7.3).
        is_placed_by_joints = deformation.skin is not None
        local = np.eye(4)[None] if is_placed_by_joints else self._local_placements(node)
        self._count(len(primitives) * len(local), "primitives", MAX_INSTANCES)
        if not is_placed_by_joints:
            local = self._with_area(local, self.nodes.to_world(index))
        to_world = local if is_placed_by_joints else self.nodes.to_world(index) @ local
        name = label(node.string("name", ""), node.where)
        for primitive in primitives:
            at = self._mesh_at_rest(primitive, mesh, deformation)
            if at is not None:
                self.instances += [Instance(name, self._fronted(at, matrix), matrix) for matrix in to_world]
                self.placed.instance_nodes += [-1 if is_placed_by_joints else index] * len(to_world)
                self.placed.instance_local += list(local)
                is_bent = self.meshes[at].skinning is not None
                skin = self._placed_skin(deformation.skin) if is_bent and deformation.skin else -1
                self.placed.instance_skins += [skin] * len(to_world)

    def _fronted(self, at: int, to_world: Float64[np.ndarray, "4 4"]) -> int:
        """The index of the mesh, or of one wound the other way where that is the front that shines.

        The front of a mirrored node winds clockwise (glTF 2.0, section 3.7.4), that of ours never does.
        """
        mesh = self.meshes[at]
        material = self.materials.materials[mesh.material]
        if not material.glows or material.emits_both_ways or np.linalg.det(to_world[:3, :3]) >= 0.0:
            return at
        if at not in self._turned:
            self._turned[at] = len(self.meshes)
            self.document.decoded.spend(mesh.triangles.nbytes + mesh.normals.nbytes, mesh.name)
            self.meshes.append(turned(mesh))
        return self._turned[at]

    def _surfaces_of(self, mesh: JsonObject) -> list[JsonObject]:
        if mesh.where not in self._surfaces:
            self._surfaces[mesh.where] = [
                primitive
                for primitive in mesh.objects("primitives")
                if self.primitives.is_surface(primitive) and not self._is_left_out(primitive)
            ]
        return self._surfaces[mesh.where]

    def _is_left_out(self, primitive: JsonObject) -> bool:
        if not (self._has_lit and self.materials.is_unlit(primitive)):
            return False
        self.materials.leave_out(primitive)
        return True

    def _placed_skin(self, skin: RestSkin) -> int:
        if skin not in self._skins:
            self._skins[skin] = len(self.placed.skins)
            self.placed.skins.append((skin.joints, skin.inverse_bind))
        return self._skins[skin]

    def _mesh_at_rest(self, primitive: JsonObject, mesh: JsonObject, deformation: Deformation) -> int | None:
        # Nodes share a mesh unless they deform it differently.
        key = (primitive.where, deformation)
        if key not in self._meshes_at_rest:
            base_color = self.materials.of(primitive)
            name = label(mesh.string("name", ""), mesh.where)
            read = self.primitives.read(primitive, name, base_color, deformation)
            self._meshes_at_rest[key] = None if read is None else len(self.meshes)
            self.meshes += [] if read is None else [read]
        return self._meshes_at_rest[key]

    def _local_placements(self, node: JsonObject) -> Float64[np.ndarray, "placements 4 4"]:
        """Transforms from the instances of EXT_mesh_gpu_instancing to the node; without it, the identity."""
        instancing = node.extension("EXT_mesh_gpu_instancing")
        return np.eye(4)[None] if instancing is None else self._instance_matrices(instancing)

    def _with_area(
        self, local: Float64[np.ndarray, "placements 4 4"], to_world: Float64[np.ndarray, "4 4"]
    ) -> Float64[np.ndarray, "kept 4 4"]:
        """The placements on a node whose scale leaves area; the others are dropped with a warning."""
        # A surface has area if two singular values are above zero. 1e-12 is far below float32's resolution.
        stretch = np.linalg.svd((to_world @ local)[:, :3, :3], compute_uv=False)
        is_surface = stretch[:, 1] > 1e-12 * stretch[:, 0]
        for _ in range(int((~is_surface).sum())):
            self.document.warnings.tally(
                "1 node is scaled to a line or a point and draws nothing",
                "{n} nodes are scaled to a line or a point and draw nothing",
            )
        return local[is_surface]

    def _instance_matrices(self, instancing: JsonObject) -> Float64[np.ndarray, "instances 4 4"]:
        attributes = instancing.required_object("attributes")
        parts = {
            key: self.accessors.referred(attributes, key, (kind,))
            for key, kind in (("TRANSLATION", "VEC3"), ("ROTATION", "VEC4"), ("SCALE", "VEC3"))
            if key in attributes.members
        }
        counts = {len(part) for part in parts.values()}
        if len(counts) != 1 or max(counts) > MAX_INSTANCES:
            raise SceneFileError(
                f"{attributes.where}: TRANSLATION, ROTATION and SCALE must have one count of at most "
                f"{MAX_INSTANCES:,}, got {sorted(counts)}"
            )
        count = counts.pop()
        values = {key: part.as_floats().astype(np.float64) for key, part in parts.items()}
        rotation = values.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))
        if not np.linalg.norm(rotation, axis=1).all():
            raise SceneFileError(f"{attributes.at('ROTATION')}: must be unit quaternions, got zero")
        return trs_matrices(
            values.get("TRANSLATION", np.zeros((count, 3))),
            rotation,
            values.get("SCALE", np.ones((count, 3))),
        )
