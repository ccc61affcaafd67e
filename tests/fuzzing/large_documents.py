"""Large documents of one kind of thing: the work for each must not grow with their number."""

import math
import random
from typing import Any

from tests.fuzzing.gltf_seeds import GltfSeed

SIZES = (1_000, 10_000, 100_000)
"""A choice: a reader that is quadratic takes more than 2 s for the last, a linear one less."""


def grow_gltf(seed: GltfSeed, rng: random.Random) -> None:
    """Repeat one kind of member of the document, or make its nodes one long chain."""
    count = rng.choice(SIZES)
    document, primitive = seed.document, seed.primitive
    nodes: list[Any] = document["nodes"]
    start = len(nodes)
    match rng.randrange(9):
        case 0:  # nodes with the same mesh, skin, camera or light
            nodes += [nodes[rng.choice((0, 0, 1, 2))]] * count
            document["scenes"][0]["nodes"] = [0, *range(start, start + count)]
        case 1:  # a chain of nodes
            nodes += [{"children": [start + i + 1], "translation": [1e-6, 0, 0]} for i in range(count)] + [{}]
            document["scenes"][0]["nodes"].append(start)
        case 2:  # a skin of many joints, which many nodes may have
            nodes += [{}] * count
            document["skins"] = [{"joints": list(range(start, start + count))}]
            nodes += [{"mesh": 0, "skin": 0}] * rng.choice((1, 100, 2000))
            document["scenes"][0]["nodes"] = list(range(len(nodes)))
        case 3:
            document["meshes"][0]["primitives"] *= count
        case 4:  # as before, each with a material of its own
            document["materials"] = [{"name": f"material {i}"} for i in range(count)]
            parts = [primitive | {"material": i} for i in range(count)]
            document["meshes"][0]["primitives"] = parts
        case 5:
            position = primitive["attributes"]["POSITION"]
            primitive["targets"] = [{"POSITION": position}] * count
            document["meshes"][0]["weights"] = [1e-6] * count
        case 6:
            for animation in document.get("animations", []):
                animation["channels"] *= count
            document["nodes"] += [{"name": "x" * 20}] * count
        case 7:  # many corners, in one primitive
            corners = bytes(range(len(seed.positions))) * (30 * count // len(seed.positions))
            corners = corners[: len(corners) // 3 * 3]
            accessor: dict[str, Any] = {"componentType": 5121, "count": len(corners), "type": "SCALAR"}
            primitive["indices"] = seed.add("accessors", accessor | {"bufferView": seed.view(corners)})
            document["buffers"][0]["byteLength"] = len(seed.blob)
        case _:
            document["bufferViews"] += document["bufferViews"] * (count // len(document["bufferViews"]))
            document["accessors"] += document["accessors"] * (count // len(document["accessors"]))


def large_obj(rng: random.Random) -> tuple[str, str]:
    """An OBJ and its MTL with many lines of one kind."""
    count = rng.choice(SIZES)
    head = "mtllib scene.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n"
    face = "f 1 2 3\n"
    match rng.randrange(8):
        case 0:
            return _polygon_obj(count, rng), ""
        case 1:
            return head + "".join(f"usemtl m{i}\n{face}" for i in range(count)), ""
        case 2:
            return head + "mtllib a b c d e f\n" * count + face, ""
        case 3:
            return head + face, "".join(f"newmtl m{i}\nmap_Kd map.png\n" for i in range(count)) + "newmtl a\n"
        case 4:
            maps = "".join(f"newmtl m{i}\nmap_Kd missing{i}.png\n" for i in range(count // 10))
            return head + "".join(f"usemtl m{i}\n{face}" for i in range(count // 10)), maps
        case 5:
            return head + face, f"newmtl a\nmap_Kd {'-mm 0 1 ' * count}map.png\n"
        case 6:
            return head + "f " + "1/1 2/1 3/1 " * count + "\n", ""
        case _:
            return head + "".join(_polygon_obj(rng.choice((8, 100)), rng) for _ in range(count // 100)), ""


def polygon(count: int, rng: random.Random) -> list[tuple[float, float]]:
    """Corners of one face: a star, a comb or a spiral, none of which an ear is easily found in."""
    turns = [2.0 * math.pi * i / count for i in range(count)]
    match rng.randrange(4):
        case 0:
            radii = [1.0 if i % 2 else 0.5 for i in range(count)]
        case 1:
            radii = [rng.random() + 0.1 for _ in range(count)]
        case 2:
            return [(i / count, float(i % 2)) for i in range(count - 1)] + [(0.5, -1.0)]
        case _:
            half = count // 2
            spiral = [(8 * turn, 1 + turn) for turn in turns[:half]]
            back = [(angle, radius - 0.2) for angle, radius in reversed(spiral)]
            return [(math.cos(angle) * radius, math.sin(angle) * radius) for angle, radius in spiral + back]
    return [
        (math.cos(turn) * radius, math.sin(turn) * radius) for turn, radius in zip(turns, radii, strict=True)
    ]


def _polygon_obj(count: int, rng: random.Random) -> str:
    corners = polygon(count, rng)
    vertices = "".join(f"v {x:.4f} {y:.4f} 0\n" for x, y in corners)
    return vertices + "f " + " ".join(str(i - len(corners)) for i in range(len(corners))) + "\n"
