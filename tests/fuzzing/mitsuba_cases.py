"""Cases of Mitsuba XML: a tree of elements, of which some are changed, and the meshes and images it names."""

import io
import random
import tempfile
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np
import OpenEXR
from PIL import Image

from tests.fuzzing.byte_mutations import mutate_bytes
from tests.fuzzing.environment_cases import hdr_image
from tests.fuzzing.extremes import DEPTHS, LONGEST_TEXT, STRINGS, number_text
from tests.fuzzing.gltf_cases import SHARE_LARGE

_XML = """<scene version="3.0.0">
<default name="resx" value="64"/>
<sensor type="perspective"><float name="fov" value="50"/><string name="fov_axis" value="smaller"/>
<transform name="to_world"><lookat origin="0, 1, 5" target="0, 1, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="$resx"/><integer name="height" value="48"/></film>
<sampler type="independent"/></sensor>
<sensor type="thinlens"><string name="focal_length" value="50mm"/></sensor>
<integrator type="path"><integer name="max_depth" value="2"/></integrator>
<bsdf type="twosided" id="white"><bsdf type="diffuse"><rgb name="reflectance" value="0.8 0.7 0.6"/></bsdf></bsdf>
<bsdf type="blendbsdf" id="mixed"><float name="weight" value="0.3"/><ref id="white"/>
<bsdf type="roughconductor"><string name="material" value="Cu"/><spectrum name="eta" value="400:1, 500:1.2, 700:0.2"/></bsdf></bsdf>
<bsdf type="plastic" id="wood"><texture type="bitmap" name="diffuse_reflectance"><string name="filename" value="map.png"/>
<string name="wrap_mode" value="mirror"/><boolean name="raw" value="true"/>
<transform name="to_uv"><scale x="2" y="2"/><rotate z="1" angle="30"/></transform></texture></bsdf>
<bsdf type="mask" id="tiles"><bsdf type="roughdiffuse"><texture type="checkerboard" name="reflectance">
<srgb name="color0" value="#102030"/><float name="uscale" value="4"/></texture></bsdf></bsdf>
<alias id="white" as="plain"/>
<texture type="scale" id="dark"><float name="scale" value="0.5"/><texture type="checkerboard"/></texture>
<bsdf type="diffuse" id="shade"><ref name="reflectance" id="dark"/></bsdf>
<bsdf type="dielectric" id="glass"/>
<shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate x="1" angle="-90"/></transform><ref id="white"/></shape>
<shape type="cube"><transform name="to_world"><translate x="1"/></transform><ref id="mixed"/></shape>
<shape type="sphere"><point name="center" x="-1" y="1"/><float name="radius" value="0.5"/><ref id="wood"/></shape>
<shape type="disk"><boolean name="flip_normals" value="true"/><emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>
<shape type="rectangle"><emitter type="area"><texture type="bitmap" name="radiance"><string name="filename" value="map.png"/></texture></emitter></shape>
<shape type="cylinder"><point name="p0" value="0 0 0"/><point name="p1" value="0 2 0"/><ref id="tiles"/></shape>
<shape type="obj"><string name="filename" value="mesh.obj"/><boolean name="face_normals" value="true"/><ref id="shade"/></shape>
<shape type="ply"><string name="filename" value="mesh.ply"/><boolean name="flip_tex_coords" value="true"/>
<transform name="to_world"><matrix value="1 0 0 0 0 1 0 0 0 0 1 3 0 0 0 1"/></transform><ref id="plain"/></shape>
<shape type="shapegroup" id="group"><shape type="cube"><ref id="glass"/></shape><shape type="rectangle"/></shape>
<shape type="instance"><ref id="group"/><transform name="to_world"><translate value="0 0 -2"/></transform></shape>
<emitter type="point"><point name="position" value="0 2 0"/><rgb name="intensity" value="1 2 3"/></emitter>
<emitter type="spot"><transform name="to_world"><lookat origin="0 2 0" target="0 0 0.1"/></transform>
<float name="cutoff_angle" value="40"/><float name="beam_width" value="10"/></emitter>
<emitter type="directional"><vector name="direction" x="0.1" y="-1" z="0"/><spectrum name="irradiance" value="2"/></emitter>
<emitter type="envmap"><string name="filename" value="sky.exr"/><float name="scale" value="2"/></emitter>
<emitter type="envmap"><string name="filename" value="sky.hdr"/><transform name="to_world"><rotate x="1" y="1" angle="70"/></transform></emitter>
<emitter type="constant"/>
<emitter type="sunsky"/>
<medium type="homogeneous"/>
</scene>"""  # noqa: E501
_OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nvt 0 0\nvt 1 1\nf 1/1 2/2 3/1\nf 2 4 3\n"
_PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float u
property float v
element face 2
property list uchar int vertex_indices
end_header
0 0 0 0 0
1 0 0 1 0
0 1 0 0 1
1 1 1 1 1
3 0 1 2
3 1 3 2
"""


@dataclass(eq=False)
class Element:
    """An XML element without text."""

    tag: str
    attributes: dict[str, str]
    children: list["Element"] = field(default_factory=list)

    def text(self) -> str:
        """The element as XML. Without recursion, as trees are deeper than Python's own limit."""
        parts: list[str] = []
        left: list[Element | str] = [self]
        while left:
            top = left.pop()
            if isinstance(top, str):
                parts.append(top)
                continue
            attributes = "".join(f" {name}={quoteattr(value)}" for name, value in top.attributes.items())
            parts.append(f"<{top.tag}{attributes}>")
            left += [f"</{top.tag}>", *reversed(top.children)]
        return "".join(parts)

    def copy(self) -> "Element":
        """The element with everything below it."""
        made = Element(self.tag, dict(self.attributes))
        left = [(self, made)]
        while left:
            source, target = left.pop()
            for child in source.children:
                target.children.append(Element(child.tag, dict(child.attributes)))
                left.append((child, target.children[-1]))
        return made


def write_mitsuba_case(folder: Path, rng: random.Random, mutated: bool) -> Path:
    """Write a case into `folder`; the path of the scene."""
    root = _seed().copy()
    # A part of the plugins only: an error in one hides those behind it.
    optional = [each for each in root.children if each.tag in ("emitter", "sensor", "shape", "medium")][1:]
    left_out = [each for each in optional if each.attributes.get("id") is None and rng.random() < 0.4]
    root.children = [each for each in root.children if each not in left_out]
    image, sky = _images()
    files = {"mesh.obj": _OBJ.encode(), "mesh.ply": _PLY.encode(), "map.png": image, "sky.exr": sky}
    files["sky.hdr"] = hdr_image(rng)
    choice = rng.random() if mutated else 1.0
    if mutated and rng.random() < SHARE_LARGE:
        # Equal names and ids, each time defined anew.
        root.children += root.children * rng.choice((30, 300))
    elif choice < 0.85:
        _mutate(root, rng)
    content = root.text().encode("utf-8", "surrogatepass")
    if choice < 0.04:
        content = rng.choice(_PROLOGUES) + content
    elif 0.85 <= choice < 0.95:
        name = rng.choice(("sky.exr", *files))
        files[name] = mutate_bytes(files[name], rng)
    elif 0.95 <= choice < 1.0:
        content = mutate_bytes(content, rng)
    for name, file in files.items():
        (folder / name).write_bytes(file)
    path = folder / "scene.xml"
    path.write_bytes(content)
    return path


# Encodings and document types, before the root.
_PROLOGUES = tuple(
    f'<?xml version="1.0" encoding="{name}"?>'.encode() for name in ("utf-16", "latin-1", "x", "idna")
)
_PROLOGUES += (
    b'<!DOCTYPE s [<!ENTITY a "b">]>',
    b'<!DOCTYPE s SYSTEM "/etc/passwd">',
    b"\xef\xbb\xbf",
    b"<!---->",
)


@cache
def _seed() -> Element:
    def element(node: ElementTree.Element) -> Element:
        return Element(node.tag, dict(node.attrib), [element(child) for child in node])

    return element(ElementTree.fromstring(_XML))


@cache
def _images() -> tuple[bytes, bytes]:
    stream = io.BytesIO()
    Image.new("RGB", (4, 4), (200, 100, 50)).save(stream, "PNG")
    pixels = np.zeros((8, 16, 3), np.float32)
    pixels[1, 3] = 100.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sky.exr"
        OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGB": pixels}).write(str(path))
        return stream.getvalue(), path.read_bytes()


def _mutate(root: Element, rng: random.Random) -> None:
    for _ in range(min(1 + int(rng.expovariate(1.0)), 5)):
        places = _places(root)
        parent, at = rng.choice(places)
        node = parent.children[at]
        match rng.randrange(14):
            case 0 | 1 | 2 | 3 | 4 | 5:
                _change_attribute(node, places, rng)
            case 6:
                parent.children.pop(at)
            case 7:
                times = 2 ** rng.choice((0, 0, 2, 5, 8))
                times = min(times, LONGEST_TEXT // len(node.text()))
                parent.children[at:at] = [node.copy() for _ in range(times)]
            case 8 | 9:
                source, index = rng.choice(places)
                parent.children[at] = source.children[index].copy()
            case 10:
                source, index = rng.choice(places)
                node.children.append(source.children[index].copy())
            case 11:
                node.tag = rng.choice(places)[0].tag if rng.random() < 0.8 else "odd"
            case 12:
                _wrap(parent, at, rng)
            case _:
                root.children[0:0] = _chain(rng)
        if not root.children:
            return


def _places(root: Element) -> list[tuple[Element, int]]:
    found, left = [], [root]
    while left and len(found) < 5000:
        node = left.pop()
        found += [(node, at) for at in range(len(node.children))]
        left += node.children
    return found


def _change_attribute(node: Element, places: list[tuple[Element, int]], rng: random.Random) -> None:
    if not node.attributes:
        node.attributes["value"] = number_text(rng)
        return
    name = rng.choice(sorted(node.attributes))
    choice = rng.random()
    if choice < 0.1:
        node.attributes.pop(name)
    elif choice < 0.3:
        texts = [text for parent, at in places for text in parent.children[at].attributes.values()]
        node.attributes[name] = rng.choice(texts)
    elif choice < 0.45:
        node.attributes[name] = rng.choice(STRINGS)
    else:
        # One number of several, so that the others still count.
        words = node.attributes[name].split(" ")
        words[rng.randrange(len(words))] = number_text(rng)
        node.attributes[name] = " ".join(words)


def _wrap(parent: Element, at: int, rng: random.Random) -> None:
    """Put an element into many like it."""
    node = parent.children[at]
    most = LONGEST_TEXT // len(Element(node.tag, node.attributes).text())
    for _ in range(min(rng.choice(DEPTHS), 1100, most)):
        node = Element(node.tag, dict(node.attributes), [node])
    parent.children[at] = node


def _chain(rng: random.Random) -> list[Element]:
    """Definitions of which each uses the one before twice: a few lines ask for 2ⁿ of something."""
    length = rng.choice((3, 10, 24, 40))
    if rng.random() < 0.5:
        first = Element("default", {"name": "a0", "value": "1" * 10})
        return [first] + [
            Element("default", {"name": f"a{i}", "value": f"$a{i - 1}$a{i - 1}"}) for i in range(1, length)
        ]
    kind, inner = rng.choice(
        (("bsdf", "blendbsdf"), ("bsdf", "twosided"), ("texture", "scale"), ("shape", "shapegroup"))
    )
    links = [
        Element(kind, {"type": {"bsdf": "diffuse", "shape": "cube"}.get(kind, "checkerboard"), "id": "c0"})
    ]
    for i in range(1, length):
        uses = [Element("ref", {"id": f"c{i - 1}"}) for _ in range(2)]
        links.append(Element(kind, {"type": inner, "id": f"c{i}"}, uses))
    user = Element(
        "shape",
        {"type": "instance" if kind == "shape" else "cube"},
        [Element("ref", {"id": f"c{length - 1}"})],
    )
    return [*links, user]
