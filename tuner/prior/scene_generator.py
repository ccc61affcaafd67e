"""Generate varied small scenes: rooms, halls, corridors and courtyards with furniture, colours and lights.

They are training scenes for a prior. Each has a camera, lights, and a random scale between 0.01 and 100, so
that nothing learnt depends on a unit. The same number and seed give the same scene, bit for bit.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.scene import Camera, Instance, Light, Material, Mesh, Scene, scaled
from vpltune.renderer.scene.transforms import look_at

Corner = np.ndarray | list[float]

KINDS = ("room", "hall", "corridor", "courtyard", "two_rooms")
"""Kinds of scenes; consecutive numbers cycle through them."""

CUBE_SIDES = np.array(
    [
        [[1, -1, -1], [0, 2, 0], [0, 0, 2]],
        [[-1, -1, -1], [0, 0, 2], [0, 2, 0]],
        [[-1, 1, -1], [0, 0, 2], [2, 0, 0]],
        [[-1, -1, -1], [2, 0, 0], [0, 0, 2]],
        [[-1, -1, 1], [2, 0, 0], [0, 2, 0]],
        [[-1, -1, -1], [0, 2, 0], [2, 0, 0]],
    ],
    np.float64,
)
"""[sides, 3, 3]: the sides of the cube [-1, 1]³ as parallelograms (origin, u, v); u × v points outwards."""


def parallelograms(name: str, corners: Float64[np.ndarray, "quads 3 3"], material: int) -> Mesh:
    """A mesh of parallelograms (origin, u, v) with normals u × v."""
    origin, u, v = corners[:, 0], corners[:, 1], corners[:, 2]
    normals = np.cross(u, v)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    positions = np.stack([origin, origin + u, origin + u + v, origin + v], axis=1).reshape(-1, 3)
    first = 4 * np.arange(len(corners))[:, None, None]
    count = len(positions)
    return Mesh(
        name,
        positions.astype(np.float32),
        np.repeat(normals, 4, axis=0).astype(np.float32),
        np.zeros((count, 2), np.float32),
        np.ones((count, 3), np.float32),
        (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32),
        material,
    )


@dataclass
class _Builder:
    """The meshes and materials so far, and the bounding boxes that are taken."""

    random: np.random.Generator
    meshes: list[Mesh] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    taken: list[Float64[np.ndarray, "2 3"]] = field(default_factory=list)

    def material(self, grey: bool = False) -> int:
        """Add a random material, light and pale if `grey`, else of any colour, and return its index."""
        level, tint = (self.random.uniform(0.5, 0.85), 0.1) if grey else (self.random.uniform(0.1, 0.8), 0.9)
        hue = self.random.uniform(1.0 - tint, 1.0, 3)
        color = np.clip(level * hue / hue.max(), 0.02, 0.9).astype(np.float32)
        self.materials.append(Material(f"colour {len(self.materials)}", color))
        return len(self.materials) - 1

    def quads(self, name: str, corners: Float64[np.ndarray, "quads 3 3"], material: int) -> None:
        """Add a mesh of `parallelograms`."""
        self.meshes.append(parallelograms(name, corners, material))

    def box(
        self,
        name: str,
        low: Corner,
        high: Corner,
        material: int,
        turn: float = 0.0,
        kept: bool = True,
    ) -> None:
        """Add a closed box, turned about its vertical axis by `turn` radians; `kept` boxes count as taken."""
        low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
        center, half = (low + high) / 2.0, (high - low) / 2.0
        c, s = math.cos(turn), math.sin(turn)
        rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        sides = CUBE_SIDES * half @ rotation.T
        sides[:, 0] += center
        self.quads(name, sides, material)
        if kept:
            reach = np.abs(rotation) @ half
            self.taken.append(np.stack([center - reach, center + reach]))

    def free(self, point: Float64[np.ndarray, "3"], room: float) -> bool:
        """Whether `point` is outside every taken box, each enlarged by `room` on all sides."""
        return all((point < box[0] - room).any() or (point > box[1] + room).any() for box in self.taken)

    def free_point(self, low: np.ndarray, high: np.ndarray, room: float) -> Float64[np.ndarray, "3"]:
        """A random point between `low` and `high` that is `free`, or the last of 64 tries."""
        for _ in range(64):
            point = self.random.uniform(low, high)
            if self.free(point, room):
                break
        return point


def generated_name(number: int) -> str:
    """The name of a generated scene: its kind and number."""
    return f"{KINDS[number % len(KINDS)]}-{number:03d}"


def generated_scene(number: int, seed: int = 0) -> Scene:
    """The scene with this number, with one camera and one or two lights. Its kind is `KINDS[number % 5]`."""
    random = np.random.default_rng([seed, number])
    kind = KINDS[number % len(KINDS)]
    width, height, depth = _size(kind, random)
    low, high = np.array([-width / 2, 0.0, -depth / 2]), np.array([width / 2, height, depth / 2])
    builder = _Builder(random)
    _shell(builder, kind, low, high)
    if kind == "two_rooms":
        _partition(builder, low, high)
    if kind in ("hall", "courtyard"):
        _columns(builder, low, high)
    _furnish(builder, low, high)
    camera = _camera(builder, low, high)
    lights = _lights(builder, kind, low, high)
    scene = replace(_scene(generated_name(number), builder), cameras=(camera,), lights=lights)
    return replace(scaled(scene, 10.0 ** random.uniform(-2.0, 2.0)), name=scene.name)


def _scene(name: str, builder: _Builder) -> Scene:
    """A scene with one untransformed instance of each mesh."""
    return Scene(
        name=name,
        meshes=tuple(builder.meshes),
        instances=tuple(Instance(mesh.name, i, np.eye(4)) for i, mesh in enumerate(builder.meshes)),
        materials=tuple(builder.materials),
    )


def _size(kind: str, random: np.random.Generator) -> tuple[float, float, float]:
    """Width, height and depth in metres, before the scene is scaled."""
    if kind == "corridor":
        return random.uniform(1.2, 2.0), random.uniform(2.2, 3.0), random.uniform(7.0, 12.0)
    if kind in ("hall", "courtyard"):
        return random.uniform(8.0, 14.0), random.uniform(4.0, 7.0), random.uniform(8.0, 16.0)
    return random.uniform(3.0, 6.0), random.uniform(2.2, 3.2), random.uniform(3.0, 6.0)


def _shell(builder: _Builder, kind: str, low: np.ndarray, high: np.ndarray, without: str = "") -> None:
    """Add floor, walls and ceiling, all facing inwards. Each has its own colour with a probability of 0.4.

    A courtyard has no ceiling, and the side named `without` is left out.
    """
    size = high - low
    x, y, z = np.diag(size)
    walls = {
        "floor": [low, z, x],
        "left": [low, y, z],
        "right": [low + x, z, y],
        "back": [low, x, y],
        "front": [low + z, y, x],
    }
    if kind != "courtyard":
        walls["ceiling"] = [low + y, x, z]
    walls.pop(without, None)
    pale = builder.material(grey=True)
    for name, corners in walls.items():
        own = builder.random.uniform() < 0.4
        builder.quads(name, np.array([corners]), builder.material() if own else pale)


def _partition(builder: _Builder, low: np.ndarray, high: np.ndarray) -> None:
    """Add a wall with a doorway across the room."""
    random, material = builder.random, builder.material(grey=True)
    z = random.uniform(0.4, 0.6) * (high[2] - low[2]) + low[2]
    thickness = random.uniform(0.05, 0.2)
    width = random.uniform(0.7, 1.2)
    start = random.uniform(low[0] + 0.1, high[0] - 0.1 - width)
    top = min(2.0, 0.85 * high[1])
    for name, a, b in (
        ("wall before the door", (low[0], 0.0), (start, high[1])),
        ("wall behind the door", (start + width, 0.0), (high[0], high[1])),
        ("lintel", (start, top), (start + width, high[1])),
    ):
        builder.box(name, [a[0], a[1], z], [b[0], b[1], z + thickness], material)


def _columns(builder: _Builder, low: np.ndarray, high: np.ndarray) -> None:
    """Add two rows of columns."""
    random, material = builder.random, builder.material(grey=True)
    side, count = random.uniform(0.25, 0.6), int(random.integers(2, 5))
    inset = random.uniform(0.18, 0.3) * (high[0] - low[0])
    for x in (low[0] + inset, high[0] - inset):
        for z in np.linspace(low[2], high[2], count + 2)[1:-1]:
            builder.box(
                "column", [x - side / 2, 0.0, z - side / 2], [x + side / 2, high[1], z + side / 2], material
            )


def _furnish(builder: _Builder, low: np.ndarray, high: np.ndarray) -> None:
    """Add crates, tables, shelves and boards at free places."""
    random = builder.random
    floor = (high[0] - low[0]) * (high[2] - low[2])
    for _ in range(int(random.integers(2, 5 + min(10, floor / 8.0)))):
        reach = random.uniform(0.2, 0.22 * min(high[0] - low[0], 5.0))
        place = builder.free_point(
            np.array([low[0] + reach, 0.0, low[2] + reach]),
            np.array([high[0] - reach, 0.0, high[2] - reach]),
            reach,
        )
        if builder.free(place, reach):
            pieces = (_crate, _table, _shelf, _board)
            piece = pieces[random.choice(len(pieces))]
            piece(builder, place, reach, high[1], random.uniform(0.0, math.pi))


def _crate(builder: _Builder, place: np.ndarray, reach: float, height: float, turn: float) -> None:
    tall = builder.random.uniform(0.1, 0.7) * height
    builder.box(
        "crate",
        place - np.array([reach, 0, reach]),
        place + np.array([reach, tall, reach]),
        builder.material(),
        turn,
    )


def _table(builder: _Builder, place: np.ndarray, reach: float, height: float, turn: float) -> None:
    top, material = 0.3 * height, builder.material()
    builder.box(
        "table",
        place + np.array([-reach, top - 0.04, -reach]),
        place + np.array([reach, top, reach]),
        material,
    )
    for x in (-0.9, 0.8):
        for z in (-0.9, 0.8):
            corner = place + np.array([x, 0.0, z]) * reach
            builder.box(
                "leg", corner, corner + np.array([0.1 * reach, top - 0.04, 0.1 * reach]), material, kept=False
            )


def _shelf(builder: _Builder, place: np.ndarray, reach: float, height: float, turn: float) -> None:
    material = builder.material()
    tall = builder.random.uniform(0.5, 0.9) * height
    deep = 0.4 * reach
    for y in np.linspace(0.1 * tall, tall, int(builder.random.integers(3, 6))):
        builder.box(
            "shelf", place + np.array([-reach, y - 0.03, -deep]), place + np.array([reach, y, deep]), material
        )
    for x in (-reach, reach):
        builder.box(
            "side",
            place + np.array([x - 0.02, 0.0, -deep]),
            place + np.array([x + 0.02, tall, deep]),
            material,
            kept=False,
        )


def _board(builder: _Builder, place: np.ndarray, reach: float, height: float, turn: float) -> None:
    tall = builder.random.uniform(0.4, 0.8) * height
    low, high = place - np.array([reach, 0.0, 0.03]), place + np.array([reach, tall, 0.03])
    builder.box("board", low, high, builder.material(), turn)


def _camera(builder: _Builder, low: np.ndarray, high: np.ndarray) -> Camera:
    """A camera near one end that looks towards the other."""
    size = high - low
    near = low + size * [0.1, 0.4, 0.8]
    eye = builder.free_point(near, low + size * [0.9, 0.7, 0.95], 0.05 * size.min())
    target = builder.random.uniform(low + size * [0.2, 0.1, 0.0], low + size * [0.8, 0.6, 0.3])
    return Camera(look_at(eye, target), math.radians(builder.random.uniform(45.0, 75.0)))


def _lights(builder: _Builder, kind: str, low: np.ndarray, high: np.ndarray) -> tuple[Light, ...]:
    """A directional light in a courtyard; elsewhere a spot light, a point light, or one of each."""
    random, size = builder.random, high - low
    power = float(size @ size)
    if kind == "courtyard":
        azimuth, slope = random.uniform(0.0, 2.0 * math.pi), random.uniform(0.7, 2.0)
        direction = np.array([math.cos(azimuth), -slope, math.sin(azimuth)])
        return (Light("directional", _tint(random), direction_world=direction / np.linalg.norm(direction)),)
    place = builder.free_point(
        low + size * [0.15, 0.4, 0.15], low + size * [0.85, 0.9, 0.85], 0.05 * size.min()
    )
    target = random.uniform(low + size * [0.1, 0.0, 0.1], low + size * [0.9, 0.7, 0.9])
    # A target too close to the light gives no usable direction.
    towards = (
        target - place if np.linalg.norm(target - place) > 0.1 * size.min() else np.array([0.0, -1.0, 0.0])
    )
    outer = random.uniform(0.35, 1.0)
    spot = Light(
        "spot",
        power * _tint(random),
        place,
        towards / np.linalg.norm(towards),
        random.uniform(0.0, 0.9) * outer,
        outer,
    )
    lamp = Light("point", 0.3 * power * _tint(random), place)
    return ((spot,), (lamp,), (spot, replace(lamp, intensity=0.1 * lamp.intensity)))[
        int(random.choice(3, p=(0.6, 0.3, 0.1)))
    ]


def _tint(random: np.random.Generator) -> Float64[np.ndarray, "3"]:
    return random.uniform(0.7, 1.0, 3)


def room_and_hall() -> Scene:
    """A fixed scene: a small room at z > 0 and a hall at z < 0, with a doorway between them at x = 0."""
    builder = _Builder(np.random.default_rng(7))
    room_low, room_high = np.array([-1.6, 0.0, 0.0]), np.array([1.6, 2.5, 5.0])
    hall_low, hall_high = np.array([-7.0, 0.0, -16.0]), np.array([7.0, 6.5, 0.0])
    _shell(builder, "room", room_low, room_high, without="back")
    _shell(builder, "hall", hall_low, hall_high, without="front")
    wall = builder.material(grey=True)
    for low, high in (([-7.0, 0.0], [-0.5, 6.5]), ([0.5, 0.0], [7.0, 6.5]), ([-0.5, 2.0], [0.5, 6.5])):
        builder.box("wall", [*low, -0.15], [*high, 0.0], wall)
    _columns(builder, hall_low, hall_high)
    for place, reach in (([-1.1, 0.0, 1.0], 0.3), ([1.2, 0.0, 3.4], 0.3), ([3.5, 0.0, -4.0], 0.7)):
        _crate(builder, np.array(place), reach, 2.5, 0.4)
    _shelf(builder, np.array([-3.5, 0.0, -9.0]), 0.9, 3.0, 0.0)
    return _scene("room-and-hall", builder)
