"""Cases of Wavefront OBJ with its MTL and a map: lines of words, of which some are changed."""

import io
import random
from pathlib import Path

from PIL import Image

from tests.fuzzing.byte_mutations import mutate_bytes
from tests.fuzzing.extremes import LONGEST_TEXT, STRINGS, number_text
from tests.fuzzing.gltf_cases import SHARE_LARGE
from tests.fuzzing.large_documents import large_obj

# Two walls, a floor of a concave polygon, a strip of quads with negative indices, vertex colours, and curves.
_OBJ = """# a corner
mtllib scene.mtl
o corner
v 0 0 0
v 2 0 0
v 2 0 2
v 1 0 0.5
v 0 0 2
v 0 2 0 0.5 0.5 1
v 2 2 0 1 1 0.5
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 1 0
vn 0 0 1
g floor
usemtl white
s off
f 1//1 2//1 3//1 4//1 5//1
usemtl wood
f 1/1/2 2/2/2 7/3/2 6/4/2
v 0 0 0
v 0 0 2
v 0 2 2
v 0 2 0
f -4 -3 -2 -1
l 1 2
p 1
vp 0.5 0.5
curv 0 1 1 2
"""
_MTL = """newmtl white
Kd 0.8 0.8 0.7
Ka 0 0 0
Ks 0.5 0.5 0.5
Ns 10
d 1
illum 2
newmtl wood
Kd 0.5 0.4 0.3
map_Kd -s 1 1 1 -o 0 0 0 -clamp off map.png
Tf 1 1 1
Ke 4 2 1
map_Ke map.png
"""
# Keywords and options of both formats that the seeds lack.
_WORDS = (
    *("fo", "usemap", "mtllib", "usemtl", "newmtl", "map_Kd", "map_d", "bump", "Kd", "Tr", "spectral", "xyz"),
    *(
        "-mm",
        "-blendu",
        "-texres",
        "-imfchan",
        "-t",
        "call",
        "scmp",
        "\\",
        "f",
        "v",
        "vt",
        "vn",
        "1//",
        "/1/1",
    ),
)


def write_obj_case(folder: Path, rng: random.Random, mutated: bool) -> Path:
    """Write a case into `folder`; the path of the scene."""
    stream = io.BytesIO()
    Image.new(rng.choice(("RGB", "L", "RGBA", "P", "I;16")), (4, 4)).save(stream, "PNG")
    contents = {"scene.obj": _OBJ.encode(), "scene.mtl": _MTL.encode(), "map.png": stream.getvalue()}
    if mutated:
        choice = rng.random()
        if rng.random() < SHARE_LARGE:
            text, library = large_obj(rng)
            contents |= {"scene.obj": text.encode(), "scene.mtl": library.encode()}
        elif choice < 0.65:
            contents["scene.obj"] = mutated_lines(_OBJ, rng, _WORDS)
        elif choice < 0.85:
            contents["scene.mtl"] = mutated_lines(_MTL, rng, _WORDS)
        else:
            name = rng.choice(sorted(contents))
            contents[name] = mutate_bytes(contents[name], rng)
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    return folder / "scene.obj"


def mutated_lines(text: str, rng: random.Random, words: tuple[str, ...]) -> bytes:
    """`text` with one to five of its lines or words changed, in UTF-8 as far as it goes."""
    lines = [line.split(" ") for line in text.splitlines()]
    for _ in range(min(1 + int(rng.expovariate(1.0)), 5)):
        if not lines:
            break
        at = rng.randrange(len(lines))
        line = lines[at]
        place = rng.randrange(len(line)) if line else 0
        match rng.randrange(10):
            case 0 | 1 | 2 | 3:
                line[place : place + 1] = [_word(line[place] if line else "", rng)]
            case 4:
                line[place : place + 1] = []
            case 5:
                line[place:place] = [rng.choice(words)]
            case 6:
                line[place:] *= _times(line[place:], rng)
            case 7:
                lines[at:at] = [list(line) for _ in range(_times(line, rng))]
            case 8:
                lines.pop(at)
            case _:
                lines.insert(rng.randrange(len(lines)), lines.pop(at))
    ending = rng.choice(("\n",) * 6 + ("\r\n", "\r", " \\\n", "\n\n"))
    return ending.join(" ".join(line) for line in lines).encode("utf-8", "surrogatepass") + ending.encode()


def _times(words: list[str], rng: random.Random) -> int:
    return min(2 ** rng.choice((1, 1, 3, 8, 13)), LONGEST_TEXT // (len(" ".join(words)) + 1))


def _word(word: str, rng: random.Random) -> str:
    if "/" in word and rng.random() < 0.7:
        parts = word.split("/")
        parts[rng.randrange(len(parts))] = number_text(rng)
        return "/".join(parts)
    return rng.choice(STRINGS) if rng.random() < 0.2 else number_text(rng)
