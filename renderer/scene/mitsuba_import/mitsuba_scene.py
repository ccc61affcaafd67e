"""A Mitsuba scene file as a `Scene`: camera, lights, diffuse materials and triangles."""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.environment import Environment
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.limits import LARGEST_UV, MAX_INSTANCES, MAX_LIGHTS, DecodedBytes
from vpltune.renderer.scene.files.plain_numbers import plain_number
from vpltune.renderer.scene.files.reading_border import read_at_border, require_few_placed
from vpltune.renderer.scene.files.surface import require_within, turned
from vpltune.renderer.scene.mitsuba_import.emitters import area_emission, punctual_light
from vpltune.renderer.scene.mitsuba_import.environment_map import ENVIRONMENTS, environment_of
from vpltune.renderer.scene.mitsuba_import.materials import MaterialReader, Surfacing
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin, plugin_tree
from vpltune.renderer.scene.mitsuba_import.searched_folder import SearchedFolder
from vpltune.renderer.scene.mitsuba_import.shapes import Shape, ShapeReader, wound_by_normals
from vpltune.renderer.scene.mitsuba_import.sun_sky import SUN_SKIES, Baker, SunSkyReader
from vpltune.renderer.scene.mitsuba_import.xml_tree import parse_xml
from vpltune.renderer.scene.scene import Camera, Instance, Light, Mesh, Scene
from vpltune.renderer.scene.transforms import without_scale

# Top-level plugins that do not affect the imported scene, or only through others: no warning for these.
_SILENT = ("integrator", "sampler", "film", "rfilter", "bsdf", "texture")


def read_mitsuba(path: str | Path, bake: Baker | None = None) -> Scene:
    """Read a Mitsuba XML scene of version 0.5 to 3.

    Lengths and radiometric values keep their numbers. Files that the scene refers to must be in its folder or
    below. `Scene.warnings` lists what is approximated or ignored.

    Args:
        path: the scene file.
        bake: computes the emitters `sky`, `sun` and `sunsky`. Without it they are ignored.

    Raises:
        InputError: the scene is invalid or unsupported. The message is one line with file, line and cause.
    """
    path = Path(path)
    return read_at_border(path, lambda: _Import(path, bake).scene())


@dataclass(eq=False)
class _Import:
    path: Path
    bake: Baker | None
    warnings: Warnings = field(default_factory=Warnings)
    decoded: DecodedBytes = field(default_factory=DecodedBytes)
    meshes: list[Mesh] = field(default_factory=list)
    instances: list[Instance] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    surfaced: dict[int, dict[int, int]] = field(default_factory=dict)
    fronted: dict[tuple[int, bool], Mesh] = field(default_factory=dict)
    groups: dict[int, list[tuple[int, Float64[np.ndarray, "4 4"]]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.folder = SearchedFolder(self.path)
        self.materials = MaterialReader(self.folder, self.warnings)
        # It keeps its meshes, so that their ids stay unique.
        self.shape_reader = ShapeReader(self.folder, self.warnings, self.decoded)

    def scene(self) -> Scene:
        root = plugin_tree(parse_xml(self.folder.read_scene_file(self.path)))
        for folder, where in root.search_paths:
            self.folder.search_first(folder, where, self.warnings)
        _check_shape_count(root)
        for plugin in root.of_kind("shape"):
            if plugin.type == "shapegroup":
                self.groups[id(plugin)] = [
                    placed for shape in plugin.of_kind("shape") if (placed := self._mesh(shape)) is not None
                ]
            elif plugin.type == "instance":
                self._place_group(plugin)
            elif (placed := self._mesh(plugin)) is not None:
                self._place(Instance(f"{plugin.type} {placed[0]}", *placed), plugin)
        if not self.instances:
            return Scene(self.path.stem, (), (), (), warnings=self.warnings.lines())
        scene = Scene(
            name=self.path.stem if self.path.stem != "scene" else self.path.resolve().parent.name,
            meshes=tuple(self.meshes),
            instances=tuple(self.instances),
            materials=tuple(self.materials.materials),
            textures=tuple(self.materials.textures),
        )
        require_few_placed(scene)
        environment = self._lights(root)
        self._warn_unread(root)
        cameras = tuple(camera for sensor in root.of_kind("sensor") if (camera := self._camera(sensor)))
        if not (self.lights or environment or any(material.glows for material in scene.materials)):
            self.warnings.add("no light could be imported: add one, or let `vpltune fit` place one")
        return replace(
            scene,
            lights=tuple(self.lights),
            cameras=cameras,
            environment=environment,
            warnings=self.warnings.lines(),
        )

    def _lights(self, root: Plugin) -> Environment | None:
        """Add the punctual lights; returns the environment, if there is one."""
        environment = None
        skies = SunSkyReader(root.version.startswith("0."), self.bake, self.warnings)
        for emitter in root.of_kind("emitter"):
            if emitter.type in SUN_SKIES:
                sky, sun = skies.read(emitter, environment is not None)
                environment = sky if environment is None else environment
                self.lights += [] if sun is None else [sun]
            elif emitter.type in ENVIRONMENTS:
                if environment is not None:
                    self.warnings.add(f"{emitter.where} is ignored: a scene has one environment")
                    continue
                environment = environment_of(emitter, self.folder, self.warnings)
            else:
                light = punctual_light(emitter, self.warnings)
                if light is not None:
                    self.lights.append(light)
        if len(self.lights) > MAX_LIGHTS:
            raise SceneFileError(f"a scene must have at most {MAX_LIGHTS:,} lights, got {len(self.lights):,}")
        return environment

    def _mesh(self, plugin: Plugin) -> tuple[int, Float64[np.ndarray, "4 4"]] | None:
        """Index of the shape's mesh and its transform to world; None if no surface is left."""
        shape = self.shape_reader.read(plugin)
        if shape is None:
            self.warnings.tally(
                "1 shape has no triangle with area; it is left out",
                "{n} shapes have no triangle with area; they are left out",
            )
            return None
        to_world = plugin.to_world() @ shape.to_shape
        bsdf = next(iter(plugin.of_kind("bsdf")), None)
        emitters = plugin.of_kind("emitter")
        emission = area_emission(emitters[0], self.materials, self.warnings) if emitters else None
        if emission is not None:
            glowing = self.materials.glowing(bsdf, emission)
            return self._surfaced(plugin, self._fronted(plugin, shape, to_world), glowing), to_world
        surfacing = self.materials.surfacing(bsdf)
        return None if surfacing is None else (self._surfaced(plugin, shape.mesh, surfacing), to_world)

    def _fronted(self, plugin: Plugin, shape: Shape, to_world: Float64[np.ndarray, "4 4"]) -> Mesh:
        """The mesh, wound counter-clockwise in the world on the side on which Mitsuba's normals point."""
        by_normals = shape.front == "normals"
        is_mirrored = by_normals and bool(np.linalg.det(to_world[:3, :3]) < 0.0)
        turns = is_mirrored != plugin.flag("flip_normals", False)
        key = (id(shape.mesh), turns)
        if key not in self.fronted:
            mesh = wound_by_normals(shape.mesh) if by_normals else shape.mesh
            mesh = turned(mesh) if turns else mesh
            if mesh is not shape.mesh:
                self.decoded.spend(mesh.triangles.nbytes + mesh.normals.nbytes, plugin.where)
            self.fronted[key] = mesh
        return self.fronted[key]

    def _surfaced(self, plugin: Plugin, mesh: Mesh, surfacing: Surfacing) -> int:
        """Index of the mesh with a material. Shapes that have both in common share it."""
        of_mesh = self.surfaced.setdefault(id(mesh), {})
        if surfacing.material not in of_mesh:
            if of_mesh:
                arrays = (mesh.positions, mesh.normals, mesh.uv, mesh.triangles)
                self.decoded.spend(sum(array.nbytes for array in arrays), plugin.where)
            uv = (mesh.uv @ surfacing.to_uv[:2, :2].T + surfacing.to_uv[:2, 2]).astype(np.float32)
            require_within(uv, "uv", LARGEST_UV, plugin.where)
            of_mesh[surfacing.material] = len(self.meshes)
            self.meshes.append(replace(mesh, material=surfacing.material, uv=uv))
        return of_mesh[surfacing.material]

    def _place_group(self, plugin: Plugin) -> None:
        for group in plugin.of_kind("shape"):
            if id(group) not in self.groups:
                raise SceneFileError(f"{plugin.where}: must refer to a shapegroup defined before it")
            for mesh, to_group in self.groups[id(group)]:
                self._place(Instance(f"instance {mesh}", mesh, plugin.to_world() @ to_group), plugin)

    def _place(self, instance: Instance, plugin: Plugin) -> None:
        if len(self.instances) == MAX_INSTANCES:
            raise SceneFileError(f"{plugin.where}: a scene must place at most {MAX_INSTANCES:,} shapes")
        self.instances.append(instance)

    def _camera(self, sensor: Plugin) -> Camera | None:
        if sensor.type not in ("perspective", "thinlens"):
            self.warnings.add(f"sensor '{sensor.type}' is ignored: only perspective cameras are imported")
            return None
        if sensor.type == "thinlens":
            self.warnings.add("the camera's depth of field is ignored")
        film = next(iter(sensor.of_kind("film")), None)
        width = film.number("width", 768.0) if film else 768.0
        height = film.number("height", 576.0) if film else 576.0
        if not (width >= 1.0 and height >= 1.0):
            raise SceneFileError(
                f"{sensor.where}: width and height of the film must be at least 1, "
                f"got {width:g} and {height:g}"
            )
        matrix = sensor.to_world()
        if np.linalg.det(matrix[:3, :3]) < 0.0:
            self.warnings.add("Mitsuba mirrors the camera's image; here it is not mirrored")
        # Mitsuba's camera looks along +Z with +X to the left, ours along −Z with +X to the right.
        rigid = without_scale(matrix @ np.diag([-1.0, 1.0, -1.0, 1.0]))
        if rigid is None:
            raise SceneFileError(f"{sensor.where}: to_world must keep the view direction and +Y independent")
        return Camera(rigid, _vertical_angle(sensor, width, height))

    def _warn_unread(self, root: Plugin) -> None:
        if any(plugin.of_kind("medium") for plugin in root.of_kind("shape")) or root.of_kind("medium"):
            self.warnings.add("participating media are ignored")
        for _, plugin in root.children:
            if plugin.kind not in (*_SILENT, "shape", "emitter", "sensor", "medium"):
                self.warnings.add(f"{plugin.where} is ignored")


def _check_shape_count(root: Plugin) -> None:
    """Refuse too many shapes before the first is read: each takes about 0.2 ms."""
    shapes: list[Plugin] = []
    for plugin in root.of_kind("shape"):
        if plugin.type != "instance":
            shapes += plugin.of_kind("shape") if plugin.type == "shapegroup" else [plugin]
    if len(shapes) > MAX_INSTANCES:
        raise SceneFileError(
            f"{shapes[MAX_INSTANCES].where}: a scene must have at most {MAX_INSTANCES:,} shapes"
        )


def _vertical_angle(sensor: Plugin, width: float, height: float) -> float:
    """Full vertical field of view in radians, from `fov` and `fov_axis` or the focal length on 35 mm film."""
    axis = sensor.text("fov_axis", "x")
    if "fov" in sensor.values:
        angle = math.radians(sensor.number("fov", 0.0))
    else:
        text = sensor.text("focal_length", "50mm").strip().removesuffix("mm")
        try:
            focal = plain_number(text)
        except ValueError:
            focal = 0.0
        if not 0.0 < focal < 1e6:
            raise SceneFileError(f"{sensor.where}: focal_length must be like '50mm', got {text!r:.40}")
        angle, axis = 2.0 * math.atan(math.hypot(36.0, 24.0) / 2.0 / focal), "diagonal"
    if not 0.0 < angle < math.pi:
        raise SceneFileError(f"{sensor.where}: fov must lie in (0, 180) degrees, got {math.degrees(angle):g}")
    sides = {
        "x": width,
        "y": height,
        "smaller": min(width, height),
        "larger": max(width, height),
        "diagonal": math.hypot(width, height),
    }
    if axis not in sides:
        raise SceneFileError(f"{sensor.where}: fov_axis must be one of {', '.join(sides)}, got {axis!r:.40}")
    return 2.0 * math.atan(math.tan(angle / 2.0) * height / sides[axis])
