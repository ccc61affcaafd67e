"""A document of ours inside a glTF file, as `extras`: any tool that keeps extras carries it along.

It stands under a key of its own in the extras of the asset and of every scene: of the tools that rewrite
glTF, some keep the one, some the other. Nothing else is changed; what the file refers to stays in place.
"""

import json
import os
import struct
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.renderer.files.glb_container import GLB_MAGIC, JSON_CHUNK
from vpltune.renderer.files.strict_json import NotFiniteError, finite_float, no_constant, not_finite_at

EXTRAS_KEY = "vpltune"
GLTF_SUFFIXES = (".gltf", ".glb")


def write_gltf_extras(scene: Path, output: Path, document: dict[str, Any]) -> None:
    """Copy the glTF file `scene` to `output`, whole or not at all, with `document` in its extras.

    What a .gltf refers to by a relative path is not copied: the paths are rewritten to lead there from the
    folder of `output`.

    Raises:
        InputError: `scene` cannot be read or is no glTF, `output` has another suffix, or cannot be written.
    """
    suffix = scene.suffix.lower()
    if suffix not in GLTF_SUFFIXES:
        raise InputError(
            f"{scene}: extras are written into a .gltf or .glb file, got {suffix or 'no suffix'!r}"
        )
    if output.suffix.lower() != suffix:
        raise InputError(f"{output}: the name must end in {suffix}, as that of {scene} does")
    root, rest = _opened(scene)
    asset = root.setdefault("asset", {})
    for holder in (asset, *root.get("scenes", [])):
        extras = holder.get("extras")
        holder["extras"] = {**(extras if isinstance(extras, dict) else {}), EXTRAS_KEY: document}
    for referring in (*root.get("buffers", []), *root.get("images", [])):
        if "uri" in referring:
            referring["uri"] = _moved_uri(referring["uri"], scene, output.parent)
    try:
        text = json.dumps(root, separators=(",", ":"), allow_nan=False).encode("ascii")
    except (ValueError, RecursionError) as error:  # a number beyond double precision
        raise InputError(f"{scene}: cannot be written again as glTF ({error})") from error
    with written_whole(output) as temporary:
        temporary.write_bytes(_glb(text, rest) if rest is not None else text)


def read_gltf_extras(scene: Path) -> dict[str, Any]:
    """The document of ours in the extras of `scene`: the asset's, or else that of the first scene with one.

    Raises:
        InputError: the file cannot be read, is no glTF, or holds none.
    """
    root, _ = _opened(scene)
    for holder in (root.get("asset", {}), *root.get("scenes", [])):
        extras = holder.get("extras")
        if isinstance(extras, dict) and isinstance(extras.get(EXTRAS_KEY), dict):
            return extras[EXTRAS_KEY]
    raise InputError(f"{scene}: holds no extras.{EXTRAS_KEY}; `vpltune export --to gltf` writes them")


def _opened(path: Path) -> tuple[dict[str, Any], bytes | None]:
    """The JSON of a glTF file, and what follows it in a .glb (None in a .gltf)."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    rest = None
    if content[:4] == GLB_MAGIC:
        if len(content) < 20:
            raise InputError(f"{path}: GLB header: must be at least 20 bytes, got {len(content)}")
        length, kind = struct.unpack_from("<II", content, 12)
        if kind != JSON_CHUNK or 20 + length > len(content):
            raise InputError(f"{path}: GLB: the first chunk must be JSON, and whole")
        content, rest = content[20 : 20 + length], content[20 + length :]
    try:
        root = json.loads(content, parse_constant=no_constant, parse_float=finite_float)
    except NotFiniteError as error:
        raise InputError(f"{path}: {not_finite_at(content)}: {error}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not JSON ({error})") from error
    _check_lists(root, path)
    return root, rest


def _check_lists(root: Any, path: Path) -> None:
    if not isinstance(root, dict) or not isinstance(root.get("asset", {}), dict):
        raise InputError(f"{path}: not a glTF document")
    for kind in ("scenes", "buffers", "images"):
        members = root.get(kind, [])
        if not isinstance(members, list) or not all(isinstance(member, dict) for member in members):
            raise InputError(f"{path}: {kind}: must be a list of objects")
    for kind in ("buffers", "images"):
        for member in root.get(kind, []):
            if not isinstance(member.get("uri", ""), str):
                raise InputError(f"{path}: {kind}: uri must be a string")


def _moved_uri(uri: str, scene: Path, target: Path) -> str:
    source = scene.parent
    scheme = uri.split(":", 1)[0]
    if uri.startswith("/") or (":" in uri and scheme.isalnum()):
        return uri  # data:, or an absolute place
    try:
        moved = quote(Path(os.path.relpath((source / unquote(uri)).resolve(), target.resolve())).as_posix())
        # Left as written where it leads the same way: a byte less that another tool could stumble over.
        same = (source / unquote(uri)).resolve() == (target / unquote(uri)).resolve()
        return uri if same else moved
    except (OSError, RuntimeError, ValueError) as error:  # too long, a loop of links, %00, a lone surrogate
        raise InputError(f"{scene}: uri {uri!r:.80} names no file ({error})") from error


def _glb(text: bytes, rest: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    header = struct.pack("<4sII", GLB_MAGIC, 2, 20 + len(text) + len(rest))
    return header + struct.pack("<II", len(text), JSON_CHUNK) + text + rest
