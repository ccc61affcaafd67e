"""Cases of glTF: seeds of which tree, buffer or container is changed, as .gltf or .glb."""

import base64
import random
import struct
from pathlib import Path

from tests.fuzzing.byte_mutations import mutate_bytes
from tests.fuzzing.extremes import NUMBERS
from tests.fuzzing.gltf_seeds import GltfSeed
from tests.fuzzing.large_documents import grow_gltf
from tests.fuzzing.tree_mutations import mutate_tree
from tests.fuzzing.tree_text import json_text

SHARE_LARGE = 0.01
"""A choice: share of cases that are large, each of which takes as long as about fifty others."""
# Chunk types "JSON" and "BIN": glTF 2.0, section 4.4.3.
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942


def write_gltf_case(folder: Path, rng: random.Random, mutated: bool) -> Path:
    """Write a case into `folder`; the path of the scene."""
    seed = GltfSeed(rng)
    container = rng.choice(("bin", "data", "glb"))
    if container == "bin":
        seed.document["buffers"][0]["uri"] = "scene.bin"
    blob = bytes(seed.blob)
    choice = rng.random() if mutated else 1.0
    if mutated and rng.random() < SHARE_LARGE:
        grow_gltf(seed, rng)
        blob = bytes(seed.blob)
    elif choice < 0.8:
        if rng.random() < 0.15:
            _ask_for_more(seed, rng)
        mutate_tree(seed.document, rng)
    if choice < 0.1 or 0.8 <= choice < 0.95:
        blob = mutate_bytes(blob, rng)
    if container == "data" and isinstance(seed.document.get("buffers"), list) and seed.document["buffers"]:
        first = seed.document["buffers"][0]
        if isinstance(first, dict):
            first["uri"] = "data:application/octet-stream;base64," + base64.b64encode(blob).decode()
    content = json_text(seed.document).encode("utf-8", "surrogatepass")
    if container == "glb":
        content = _glb(content, blob, rng if choice < 1.0 and rng.random() < 0.1 else None)
    elif container == "bin":
        (folder / "scene.bin").write_bytes(blob)
    if 0.95 <= choice < 1.0:
        content = mutate_bytes(content, rng)
    path = folder / ("scene.glb" if container == "glb" else "scene.gltf")
    path.write_bytes(content)
    return path


def _ask_for_more(seed: GltfSeed, rng: random.Random) -> None:
    """Accessors of many zeros, or of many elements on the same bytes: more memory than the file has bytes."""
    accessor = rng.choice(seed.document["accessors"])
    accessor["count"] = rng.choice((3, 300, 30_000, 3_000_000, 30_000_000, 300_000_000, 3_000_000_000))
    if rng.random() < 0.7:
        accessor.pop("bufferView", None)


def _glb(text: bytes, blob: bytes, lying: random.Random | None) -> bytes:
    text += b" " * (-len(text) % 4)
    blob += bytes(-len(blob) % 4)
    numbers = [0x46546C67, 2, 28 + len(text) + len(blob), len(text), _JSON_CHUNK, len(blob), _BINARY_CHUNK]
    if lying is not None:
        whole = [number for number in NUMBERS if isinstance(number, int)]
        at = lying.randrange(len(numbers))
        other = numbers[at] + lying.choice((-1, 1, 4)) if lying.random() < 0.5 else lying.choice(whole)
        numbers[at] = other % 2**32
    head, second = struct.pack("<5I", *numbers[:5]), struct.pack("<2I", *numbers[5:])
    return head + text + second + blob
