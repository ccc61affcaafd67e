"""Small scenes built in code, each with one thing to say."""

import numpy as np

from vpltune.renderer.scene.scene import Camera, Instance, Light, Material, Mesh, Scene
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View


def quad(origin, edge_u, edge_v, material=0, name="quad") -> Mesh:
    """The parallelogram origin, +u, +u+v, +v; its normal is u × v."""
    origin, edge_u, edge_v = (np.asarray(value, np.float32) for value in (origin, edge_u, edge_v))
    normal = np.cross(edge_u, edge_v)
    normal /= np.linalg.norm(normal)
    return Mesh(
        name,
        np.stack([origin, origin + edge_u, origin + edge_u + edge_v, origin + edge_v]),
        np.tile(normal, (4, 1)),
        np.zeros((4, 2), np.float32),
        np.ones((4, 3), np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        material,
    )


def scene_of(meshes: list[Mesh], colors: list[tuple[float, float, float]], name="built") -> Scene:
    """Each mesh placed once, untransformed; materials by color."""
    return Scene(
        name=name,
        meshes=tuple(meshes),
        instances=tuple(Instance(mesh.name, index, np.eye(4)) for index, mesh in enumerate(meshes)),
        materials=tuple(Material(f"m{i}", np.array(c, np.float32)) for i, c in enumerate(colors)),
    )


def colored_room() -> Scene:
    """A closed room of 2 × 2 × 2 about the origin, open to +Z, with a tilted board in it."""
    return scene_of(
        [
            quad((-1, -1, -1), (0, 0, 2), (2, 0, 0), 0, "floor"),
            quad((-1, 1, -1), (2, 0, 0), (0, 0, 2), 0, "ceiling"),
            quad((-1, -1, -1), (2, 0, 0), (0, 2, 0), 0, "back"),
            quad((-1, -1, -1), (0, 2, 0), (0, 0, 2), 1, "left"),
            quad((1, -1, -1), (0, 0, 2), (0, 2, 0), 2, "right"),
            quad((-0.5, -0.9, -0.5), (0.7, 0.5, 0.0), (0.0, 0.05, 0.7), 0, "board"),
        ],
        [(0.7, 0.7, 0.7), (0.7, 0.1, 0.1), (0.1, 0.7, 0.1)],
        "colored-room",
    )


ROOM_LIGHTS = {
    "spot": Light("spot", np.full(3, 4.0), np.array([0.1, 0.9, 0.05]), np.array([0.0, -1.0, 0.0]), 0.3, 0.85),
    "wide_spot": Light(
        "spot", np.full(3, 4.0), np.array([0.1, 0.9, 0.05]), np.array([0.0, -1.0, 0.0]), 0.3, 1.4
    ),
    "point": Light("point", np.array([2.0, 1.5, 1.0]), np.array([0.05, 0.45, 0.2])),
    "directional": Light("directional", np.full(3, 3.0), direction_world=np.array([0.48, -0.6, -0.64])),
}


def room_view(light: str | None = "spot", size=(64, 48)) -> View:
    """The colored room from its open side."""
    camera = Camera(look_at(np.array([0.0, 0.0, 3.6]), np.zeros(3)), float(np.radians(40.0)))
    return View(light or "dark", "fitted", size, camera, (ROOM_LIGHTS[light],) if light else ())
