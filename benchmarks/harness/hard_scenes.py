"""Small scenes in which a view is hard to place: little subject in much ground, odd shapes, odd positions."""

import math
from collections.abc import Callable

import numpy as np

from vpltune.renderer.scene.scene import Instance, Material, Mesh, Scene
from vpltune.tuner.prior.scene_generator import CUBE_SIDES, parallelograms

WHITE, RED, GREEN, BLUE, YELLOW = range(5)
# A choice: plain base colours, of which four bleed.
COLORS = ((0.7, 0.7, 0.7), (0.7, 0.1, 0.08), (0.1, 0.6, 0.15), (0.12, 0.2, 0.7), (0.75, 0.55, 0.1))
Box = tuple[tuple[float, float, float], tuple[float, float, float], int]


def hard_scenes() -> dict[str, Callable[[], Scene]]:
    """Name and maker of every scene; the names say what is hard. None has a camera or a light."""
    return {
        "object-on-2-km-plane": _object_on_plane,
        "room-in-terrain": _room_in_terrain,
        "open-box-from-behind": _open_box,
        "long-corridor": _long_corridor,
        "far-from-origin": lambda: _scene("far-from-origin", _furnished((5e4, 120.0, -8e4))),
        "two-rooms-of-two-sizes": _two_rooms,
        "table-top": _table_top,
        "thin-pieces": _thin_pieces,
        "room-without-ceiling": lambda: _scene(
            "room-without-ceiling", _furnished((0.0, 0.0, 0.0), ceiling=False)
        ),
        "open-pavilion": _pavilion,
    }


def _box(low: tuple[float, float, float], high: tuple[float, float, float], material: int) -> Mesh:
    """A closed box that faces outwards."""
    center, half = 0.5 * (np.array(high) + low), 0.5 * (np.array(high) - low)
    sides = CUBE_SIDES * half
    sides[:, 0] += center
    return parallelograms("box", sides, material)


def _shell(
    low: tuple[float, float, float], high: tuple[float, float, float], colors: tuple[int | None, ...]
) -> list[Mesh]:
    """Walls that face inwards, in the order +x, −x, +y, −y, +z, −z; a side without a colour is left out."""
    center, half = 0.5 * (np.array(high) + low), 0.5 * (np.array(high) - low)
    sides = CUBE_SIDES[:, [0, 2, 1]] * half
    sides[:, 0] += center
    return [parallelograms("wall", sides[[i]], color) for i, color in enumerate(colors) if color is not None]


def _scene(name: str, meshes: list[Mesh]) -> Scene:
    """Each mesh placed once, as it is."""
    return Scene(
        name,
        tuple(meshes),
        tuple(Instance(mesh.name, index, np.eye(4)) for index, mesh in enumerate(meshes)),
        tuple(Material(f"m{i}", np.array(color, np.float32)) for i, color in enumerate(COLORS)),
    )


def _pieces(x: float, y: float, z: float) -> list[Mesh]:
    """A table with a thing on it, a shelf and a crate, within 1.5 of a place on the floor."""
    boxes: list[Box] = [
        ((-0.7, 0.7, -0.4), (0.7, 0.76, 0.4), YELLOW),
        *(((a, 0.0, b), (a + 0.08, 0.7, b + 0.08), YELLOW) for a in (-0.68, 0.6) for b in (-0.38, 0.3)),
        ((-0.2, 0.76, -0.15), (0.15, 1.05, 0.2), BLUE),
        ((1.0, 0.0, -1.4), (1.5, 1.6, -0.9), RED),
        ((-1.5, 0.0, 0.8), (-0.9, 0.5, 1.4), GREEN),
    ]
    move = np.array([x, y, z])
    return [_box(tuple(move + low), tuple(move + high), color) for low, high, color in boxes]


def _furnished(shift: tuple[float, float, float], *, ceiling: bool = True) -> list[Mesh]:
    """A room of 5 × 2.6 × 4.4 with a red and a green wall."""
    x, y, z = shift
    above = WHITE if ceiling else None
    shell = _shell(
        (x - 2.5, y, z - 2.2), (x + 2.5, y + 2.6, z + 2.2), (GREEN, RED, above, WHITE, WHITE, WHITE)
    )
    return [*shell, *_pieces(x, y, z)]


def _object_on_plane() -> Scene:
    ground = parallelograms(
        "ground", np.array([[[-1e3, 0, -1e3], [0, 0, 2e3], [2e3, 0, 0]]], np.float64), WHITE
    )
    return _scene("object-on-2-km-plane", [ground, *_pieces(310.0, 0.0, -420.0)])


def _room_in_terrain() -> Scene:
    """Hills of 1 km with a thick-walled room on them."""
    side = np.linspace(-500.0, 500.0, 65)
    x, z = np.meshgrid(side, side, indexing="ij")
    y = 20.0 * np.sin(x / 90.0) * np.cos(z / 70.0)
    y -= y[32, 32]
    y[30:35, 30:35] = 0.0
    positions = np.stack([x, y, z], axis=-1)
    cells = [
        [[positions[i, j], positions[i, j + 1] - positions[i, j], positions[i + 1, j] - positions[i, j]]]
        for i in range(64)
        for j in range(64)
    ]
    ground = parallelograms("hills", np.concatenate(cells), GREEN)
    outside = _box((-2.7, -0.1, -2.4), (2.7, 2.8, 2.4), WHITE)
    return _scene("room-in-terrain", [ground, outside, *_furnished((0.0, 0.01, 0.0))])


def _open_box() -> Scene:
    """A box whose one open side faces −x, away from most placed cameras."""
    walls = _shell((-1.0, 0.0, -1.0), (1.0, 2.0, 1.0), (WHITE, None, WHITE, WHITE, RED, GREEN))
    return _scene("open-box-from-behind", [*walls, _box((0.0, 0.0, -0.6), (0.6, 1.1, 0.0), WHITE)])


def _long_corridor() -> Scene:
    walls = _shell((-1.0, 0.0, -20.0), (1.0, 2.5, 20.0), (GREEN, WHITE, WHITE, WHITE, RED, BLUE))
    crates = [_box((0.3, 0.0, z), (0.9, 0.9, z + 0.6), YELLOW) for z in (-14.0, -6.0, 3.0, 11.0)]
    return _scene("long-corridor", [*walls, *crates])


def _two_rooms() -> Scene:
    """A furnished room of 5 × 2.6 × 4.4 beside an empty hall of 24 × 8 × 20, without a door."""
    hall = _shell((4.0, 0.0, -10.0), (28.0, 8.0, 10.0), (WHITE, BLUE, WHITE, WHITE, WHITE, WHITE))
    return _scene("two-rooms-of-two-sizes", [*hall, *_furnished((0.0, 0.0, 0.0))])


def _table_top() -> Scene:
    """Small things on a board of 2 × 1.2, and nothing around it."""
    boxes: list[Box] = [
        ((-1.0, -0.04, -0.6), (1.0, 0.0, 0.6), YELLOW),
        ((-0.5, 0.0, -0.2), (-0.3, 0.25, 0.0), RED),
        ((-0.15, 0.0, -0.35), (0.15, 0.1, -0.05), WHITE),
        ((0.2, 0.0, 0.0), (0.3, 0.3, 0.1), BLUE),
        ((0.35, 0.0, -0.3), (0.6, 0.05, 0.3), GREEN),
    ]
    return _scene("table-top", [_box(*box) for box in boxes])


def _thin_pieces() -> Scene:
    """A tree-like scatter: 400 leaves about a trunk, on a lawn."""
    random = np.random.default_rng(1)
    leaves = random.normal((0.0, 2.2, 0.0), 0.5, (400, 3))
    u, v = random.normal(0.0, 0.07, (2, 400, 3))
    quads = np.stack([leaves, u, v], axis=1)
    lawn = parallelograms("lawn", np.array([[[-4, 0, -4], [0, 0, 8], [8, 0, 0]]], np.float64), WHITE)
    return _scene(
        "thin-pieces",
        [lawn, parallelograms("leaves", quads, GREEN), _box((-0.1, 0.0, -0.1), (0.1, 2.0, 0.1), YELLOW)],
    )


def _pavilion() -> Scene:
    """A roof on columns over a floor, open on all sides, with a low wall and things inside."""
    columns = [
        _box(
            (3.0 * math.cos(a) - 0.15, 0.0, 3.0 * math.sin(a) - 0.15),
            (3.0 * math.cos(a) + 0.15, 3.0, 3.0 * math.sin(a) + 0.15),
            WHITE,
        )
        for a in 2.0 * math.pi * np.arange(8) / 8
    ]
    slabs = [
        _box((-3.5, -0.2, -3.5), (3.5, 0.0, 3.5), WHITE),
        _box((-3.5, 3.0, -3.5), (3.5, 3.2, 3.5), RED),
    ]
    return _scene("open-pavilion", [*slabs, *columns, *_pieces(0.0, 0.0, 0.0)])
