"""List the files that a scene file may refer to, with the readers' own parsing of lines, headers and trees.

The list errs on the side of too many files: an extra one only means that a change to it triggers another fit.
Paths that leave the scene's folder are left out, since the readers reject them.
"""

import contextlib
import re
import stat
import struct
import urllib.parse
from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.glb_container import GLB_MAGIC
from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.json_object import parse_json
from vpltune.renderer.scene.files.limits import MAX_FILE_BYTES
from vpltune.renderer.scene.files.mtl_materials import MOST_LIBRARIES, map_statement, mtl_statements
from vpltune.renderer.scene.files.obj_scene import library_names
from vpltune.renderer.scene.files.ply_data import LONGEST_HEADER, parse_ply_header
from vpltune.renderer.scene.files.text_lines import first_word, text_lines
from vpltune.renderer.scene.mitsuba_import.plugin_tree import plugin_tree
from vpltune.renderer.scene.mitsuba_import.searched_folder import MOST_PATHS
from vpltune.renderer.scene.mitsuba_import.xml_tree import XmlNode, parse_xml
from vpltune.renderer.scene.placement.scene_sidecar import sidecar_of

MITSUBA_SUFFIX = ".xml"
"""Extension of a Mitsuba scene."""

# Magic, version, file length, length and type of the JSON chunk (glTF 2.0, section 4.4).
_GLB_HEADER = struct.Struct("<4sIIII")
# A string of Mitsuba's XML that names a file.
_FILE_NAME = re.compile(r".+\.[A-Za-z0-9]{2,4}")
# A choice: most names of a Mitsuba scene, each looked for in all its folders. A reader refuses 10,001 shapes.
_MOST_NAMES = 20_000


def referred_files(scene: Path) -> tuple[Path, ...]:
    """Paths of the files that `scene` names, each once, in the order of the file. Some may not exist."""
    names = chain(_names(scene), _sidecar_names(scene))
    found = dict.fromkeys(
        path for name in names if (path := _inside(scene.parent, name)) is not None and path != scene
    )
    return tuple(found)


def _sidecar_names(scene: Path) -> Iterator[str]:
    """The environment map that the scene's sidecar names."""
    with contextlib.suppress(InputError):
        sky = sidecar_of(scene).sky
        if sky is not None and sky.file is not None:
            yield sky.file


def is_mitsuba_scene(path: Path) -> bool:
    """Whether an XML file is a Mitsuba scene, judged by its first 4096 bytes."""
    return re.search(rb"<scene\b", _content(path, 4096)) is not None


def _names(scene: Path) -> Iterator[str]:
    suffix = scene.suffix.lower()
    # What breaks a rule is refused by the reader too; the names before it count.
    with contextlib.suppress(SceneFileError):
        if suffix in (".gltf", ".glb"):
            yield from _gltf_uris(_gltf_json(scene))
        elif suffix == ".obj":
            yield from _obj_names(scene)
        elif suffix == ".ply":
            yield parse_ply_header(_content(scene, LONGEST_HEADER)).texture_name
        elif suffix == MITSUBA_SUFFIX:
            yield from _mitsuba_names(scene, parse_xml(_content(scene)))


def _gltf_json(scene: Path) -> bytes:
    """A .gltf file, or the JSON chunk of a .glb file without the rest, which may be large."""
    head = _content(scene, _GLB_HEADER.size)
    # Decided by content, as the reader does.
    if not head.startswith(GLB_MAGIC) or len(head) < _GLB_HEADER.size:
        return _content(scene)
    length = _GLB_HEADER.unpack(head)[3]
    return _content(scene, _GLB_HEADER.size + length)[_GLB_HEADER.size :]


def _gltf_uris(content: bytes) -> Iterator[str]:
    document = parse_json(content)
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
            with contextlib.suppress(SceneFileError):
                yield from dict.fromkeys(_map_names(_content(library), name))


def _map_names(content: bytes, where: str) -> Iterator[str]:
    for _, keyword, rest in mtl_statements(content, where):
        if keyword.lower() in ("map_kd", "map_ke", "map_d"):
            yield map_statement(rest).path


def _library_names(content: bytes) -> Iterator[str]:
    """Each once. A line holds one name that may contain spaces, or several names."""
    told: set[str] = set()
    for _, line in text_lines(content, ""):
        if b"mtllib" not in line or first_word(line)[0] != b"mtllib":
            continue
        names = library_names(line)
        for name in (names, *names.split()):
            if name not in told:
                told.add(name)
                yield name


def _mitsuba_names(scene: Path, root: XmlNode) -> Iterator[str]:
    """Strings that end like a file's name, in the folders of the scene's <path> elements and in its own.

    The reader takes the file of the last of these folders that has it. One that is absent counts too: once it
    is there, it is taken.
    """
    with contextlib.suppress(SceneFileError):
        plugin_tree(root)  # puts defaults in the place of $names
    paths = [node.attributes.get("value", "") for node in root.children if node.tag == "path"]
    folders = [path for path in paths[:MOST_PATHS] if _is_folder(scene, path)]
    names = (node.attributes.get("value", "") for node in _strings(root))
    found = dict.fromkeys(name for name in names if _FILE_NAME.fullmatch(name))
    for name in islice(found, _MOST_NAMES):
        yield from (f"{folder}/{name}" for folder in reversed(folders))
        yield name


def _strings(root: XmlNode) -> Iterator[XmlNode]:
    nodes = [root]
    while nodes:
        node = nodes.pop()
        nodes += reversed(node.children)
        if node.tag == "string":
            yield node


def _is_folder(scene: Path, name: str) -> bool:
    folder = _inside(scene.parent, name)
    return folder is not None and folder.is_dir()


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
