"""List the files that a scene file may refer to, by a quick scan of its text instead of a full parse.

The list errs on the side of too many files: an extra one only means that a change to it triggers another fit.
Paths that leave the scene's folder are left out, since the readers reject them.
"""

import re
import stat
import struct
import urllib.parse
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.json_object import parse_json
from vpltune.renderer.scene.files.limits import MAX_FILE_BYTES
from vpltune.renderer.scene.files.mtl_materials import MOST_LIBRARIES, map_statement

READ_SUFFIXES = (".gltf", ".glb", ".obj", ".ply")
"""Extensions of the scene files that `read_scene` reads."""
MITSUBA_SUFFIX = ".xml"
"""Extension of a Mitsuba scene."""

# Magic, version, file length, length and type of the JSON chunk (glTF 2.0, section 4.4).
_GLB_HEADER = struct.Struct("<4sIIII")
# Attributes and lines that name a file.
_XML_VALUE = re.compile(rb'value\s*=\s*"([^"]+\.[A-Za-z0-9]{2,4})"')
_MTLLIB = re.compile(rb"^[ \t]*mtllib[ \t]+([^\r\n]+)", re.MULTILINE)
_MAP = re.compile(rb"^[ \t]*map_Kd[ \t]+([^\r\n]+)", re.MULTILINE | re.IGNORECASE)
_TEXTURE_FILE = re.compile(rb"^comment[ \t]+TextureFile[ \t]+([^\r\n]+)", re.MULTILINE)
_PLY_HEADER_BYTES = 1 << 16  # a choice: far more than a usual header


def referred_files(scene: Path) -> tuple[Path, ...]:
    """Paths of the files that `scene` names, each once, in the order of the file. Some may not exist."""
    found = dict.fromkeys(
        path for name in _names(scene) if (path := _inside(scene.parent, name)) is not None and path != scene
    )
    return tuple(found)


def is_mitsuba_scene(path: Path) -> bool:
    """Whether an XML file is a Mitsuba scene, judged by its first 4096 bytes."""
    return re.search(rb"<scene\b", _content(path, 4096)) is not None


def _names(scene: Path) -> Iterator[str]:
    suffix = scene.suffix.lower()
    if suffix == ".gltf":
        yield from _gltf_uris(_content(scene))
    elif suffix == ".glb":
        yield from _gltf_uris(_glb_json(scene))
    elif suffix == ".obj":
        yield from _obj_names(scene)
    elif suffix == ".ply":
        for line in _TEXTURE_FILE.findall(_content(scene, _PLY_HEADER_BYTES)):
            yield _text(line)
    elif suffix == MITSUBA_SUFFIX:
        for value in _XML_VALUE.findall(_content(scene)):
            yield value.decode("utf-8", "replace")


def _glb_json(scene: Path) -> bytes:
    """The JSON chunk of a .glb file, without reading the rest, which may be large."""
    head = _content(scene, _GLB_HEADER.size)
    if len(head) < _GLB_HEADER.size:
        return b""
    length = _GLB_HEADER.unpack(head)[3]
    return _content(scene, _GLB_HEADER.size + length)[_GLB_HEADER.size :]


def _gltf_uris(content: bytes) -> Iterator[str]:
    try:
        document = parse_json(content)
    except SceneFileError:  # the reader refuses it too
        return
    for kind in ("buffers", "images"):
        members = document.members.get(kind)
        for member in members if isinstance(members, list) else ():
            uri = member.get("uri") if isinstance(member, dict) else None
            if isinstance(uri, str) and uri[:5].lower() != "data:":
                yield uri
                yield urllib.parse.unquote(uri)


def _obj_names(scene: Path) -> Iterator[str]:
    read: set[Path] = set()
    # The reader refuses a scene with more libraries.
    for name in islice(_library_names(_content(scene)), 2 * MOST_LIBRARIES):
        library = _inside(scene.parent, name)
        if library is None:
            continue
        yield name
        if library not in read:
            read.add(library)
            for mapped in dict.fromkeys(_MAP.findall(_content(library))):
                yield map_statement(_text(mapped.split(b"#", 1)[0])).path


def _library_names(content: bytes) -> Iterator[str]:
    """Each once. A line holds one name that may contain spaces, or several names."""
    told: set[str] = set()
    for line in _MTLLIB.findall(content):
        text = _text(line)
        for name in (text, *text.split()):
            if name not in told:
                told.add(name)
                yield name


def _text(line: bytes) -> str:
    return line.decode("utf-8", "replace").strip()


def _inside(folder: Path, name: str) -> Path | None:
    root = folder.resolve()
    try:
        path = (root / name.replace("\\", "/")).resolve()
    except (OSError, RuntimeError, ValueError):  # a name too long, a loop of links, a null byte
        return None
    return folder / path.relative_to(root) if path.is_relative_to(root) and path != root else None


def _content(path: Path, limit: int = MAX_FILE_BYTES) -> bytes:
    """The first `limit` bytes of a regular file; empty for anything else."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            return b""
        with path.open("rb") as file:
            return file.read(limit)
    except OSError:
        return b""
