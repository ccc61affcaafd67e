"""Cases of PLY in ASCII and both byte orders: header lines that lie, and data that do not fit them."""

import random
import struct
from pathlib import Path

from tests.fuzzing.byte_mutations import mutate_bytes
from tests.fuzzing.extremes import number_text
from tests.fuzzing.gltf_cases import SHARE_LARGE
from tests.fuzzing.large_documents import polygon
from tests.fuzzing.obj_cases import mutated_lines

# Letters of the struct module, for the types of the format.
_TYPES = {
    **{"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"},
    **{"float": "f", "double": "d", "int8": "b", "uint32": "I", "float32": "f", "float64": "d"},
}
# Words of headers that a case may lack.
_WORDS = ("list", "property", "element", "comment", "TextureFile", "obj_info", "end_header", *_TYPES)
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_VERTICES = ((0, 0, 0), (2, 0, 0), (2, 0, 2), (1, 0, 0.5), (0, 0, 2), (0, 2, 0), (2, 2, 0))
_FACES = ((0, 1, 2, 3, 4), (0, 1, 6, 5), (0, 1, 2))
_OPTIONAL = (
    ("nx", "float", 0.0),
    ("s", "float", 0.5),
    ("t", "float", 0.25),
    ("red", "uchar", 200),
    ("green", "uchar", 100),
    ("blue", "uchar", 50),
    ("quality", "double", 1.0),
)


def write_ply_case(folder: Path, rng: random.Random, mutated: bool) -> Path:
    """Write a case into `folder`; the path of the scene."""
    form = rng.choice(tuple(_FORMATS))
    extra = [each for each in _OPTIONAL if rng.random() < 0.5] if rng.random() < 0.7 else []
    coordinate = rng.choice(("float", "double", "float32")) if rng.random() < 0.9 else "int"
    counts, index = rng.choice(("uchar", "int", "uint")), rng.choice(("int", "uint", "short"))
    alike = rng.random() < 0.5
    faces = [face[:3] for face in _FACES] if alike else list(_FACES)
    if mutated and rng.random() < 0.05:
        faces *= rng.choice((10, 1000, 10_000))
    vertices: list[tuple[float, ...]] = list(_VERTICES)
    if mutated and counts != "uchar" and rng.random() < SHARE_LARGE:
        vertices = [(x, y, 0.0) for x, y in polygon(rng.choice((1000, 10_000, 30_000)), rng)]
        faces = [tuple(range(len(vertices)))]
    elif mutated and rng.random() < 0.05:
        faces[0] = faces[0] * rng.choice((2, 50)) if counts == "uchar" else faces[0] * rng.choice((10, 2000))
    header = [
        f"ply\nformat {form} 1.0\ncomment TextureFile map.png\nelement vertex {len(vertices)}",
        *(f"property {coordinate} {axis}" for axis in "xyz"),
        *(f"property {kind} {name}" for name, kind, _ in extra),
        f"element face {len(faces)}\nproperty list {counts} {index} vertex_indices\nend_header",
    ]
    rows: list[list[tuple[str, float]]] = [
        [*((coordinate, place) for place in vertex), *((kind, value) for _, kind, value in extra)]
        for vertex in vertices
    ]
    rows += [[(counts, len(face)), *((index, corner) for corner in face)] for face in faces]
    text = "\n".join(header) + "\n"
    choice = rng.random() if mutated else 1.0
    head = mutated_lines(text, rng, _WORDS) if choice < 0.5 else text.encode()
    if 0.5 <= choice < 0.75:
        row = rng.choice(rows)
        at = rng.randrange(len(row))
        row[at] = (row[at][0], rng.choice((-1, 0, 3, 127, 128, 255, 2**15, 2**31, 2**63, 1e30, -1e300, 0.5)))
    body = _body(rows, _FORMATS[form], rng if 0.65 <= choice < 0.75 else None)
    if 0.75 <= choice < 0.95:
        body = mutate_bytes(body, rng)
    content = mutate_bytes(head + body, rng) if 0.95 <= choice < 1.0 else head + body
    path = folder / "scene.ply"
    path.write_bytes(content)
    return path


def _body(rows: list[list[tuple[str, float]]], order: str, odd_word: random.Random | None) -> bytes:
    if not order:
        words = [[f"{value:g}" for _, value in row] for row in rows]
        if odd_word is not None:
            row = odd_word.choice(words)
            row[odd_word.randrange(len(row))] = number_text(odd_word)
        return "\n".join(" ".join(row) for row in words).encode("utf-8", "surrogatepass") + b"\n"
    return b"".join(_packed(order, kind, value) for row in rows for kind, value in row)


def _packed(order: str, kind: str, value: float) -> bytes:
    letter = _TYPES[kind]
    if letter in "fd":
        return struct.pack(order + letter, value if letter == "d" or abs(value) < 3e38 else float("inf"))
    width = struct.calcsize(order + letter)
    return (int(value) % 256**width).to_bytes(width, "little" if order == "<" else "big")
