"""A config inside a glTF scene: there after other tools have rewritten the file, and the scene unchanged."""

import base64
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from config_documents import OLDER_QUALITY, older_document
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.gltf_extras import EXTRAS_KEY, read_gltf_extras, write_gltf_extras
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig, config_text, read_config
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene

SCENES = Path(__file__).resolve().parents[3] / "configs" / "scenes"
CONFIG = TunedConfig(ArtistParameters(intensity=1.0 / 3.0, vpl_count=77), {"scene": "a \u00e9"}, "maps")
DOCUMENT = json.loads(config_text(CONFIG))


@pytest.fixture
def tuned_scene(tmp_path):
    write_gltf_extras(SCENES / "cornell-box.glb", tmp_path / "tuned.glb", DOCUMENT)
    return tmp_path / "tuned.glb"


def test_a_scene_carries_its_config_and_is_otherwise_the_same(tuned_scene):
    assert read_config(tuned_scene) == CONFIG
    plain, carrying = read_scene(SCENES / "cornell-box.glb"), read_scene(tuned_scene)
    for mine, other in zip(plain.meshes, carrying.meshes, strict=True):
        np.testing.assert_array_equal(mine.positions, other.positions)
        np.testing.assert_array_equal(mine.triangles, other.triangles)
    assert carrying.warnings == plain.warnings


def test_trimesh_keeps_the_config(tuned_scene, tmp_path):
    """trimesh keeps a scene's extras and writes an asset of its own: why they stand in both places."""
    trimesh.load_scene(tuned_scene).export(tmp_path / "again.glb")
    root = _glb_json(tmp_path / "again.glb")
    assert EXTRAS_KEY not in root["asset"].get("extras", {})
    assert root["scenes"][0]["extras"][EXTRAS_KEY] == DOCUMENT
    assert read_config(tmp_path / "again.glb") == CONFIG


def test_a_plain_rewriting_of_the_json_keeps_the_config(tuned_scene, tmp_path):
    """Other order of keys, indented, buffer inside as base64: a .glb unpacked to a .gltf."""
    root = _glb_json(tuned_scene)
    content = tuned_scene.read_bytes()
    binary = content[20 + struct.unpack_from("<I", content, 12)[0] + 8 :]
    root["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    (tmp_path / "again.gltf").write_text(json.dumps(root, indent=3, sort_keys=True))
    assert read_config(tmp_path / "again.gltf") == CONFIG
    assert len(read_scene(tmp_path / "again.gltf").meshes) == len(read_scene(tuned_scene).meshes)


def test_other_extras_stay_and_a_second_export_replaces_the_first(tuned_scene, tmp_path):
    root = _glb_json(tuned_scene)
    root["asset"]["extras"]["author"] = "someone"
    root["scenes"][0]["extras"] = "of another kind"
    (tmp_path / "a.gltf").write_text(json.dumps(root))
    replaced = CONFIG.seen_by("transmittance")
    write_gltf_extras(tmp_path / "a.gltf", tmp_path / "b.gltf", json.loads(config_text(replaced)))
    written = json.loads((tmp_path / "b.gltf").read_text())
    assert written["asset"]["extras"]["author"] == "someone"
    assert read_config(tmp_path / "b.gltf") == replaced


def test_relative_paths_still_lead_to_the_buffers(tmp_path):
    source = _gltf_triangle(tmp_path / "from here")
    write_gltf_extras(source, tmp_path / "to" / "tuned.gltf", DOCUMENT)
    written = json.loads((tmp_path / "to" / "tuned.gltf").read_text())
    assert written["buffers"][0]["uri"] == "../from%20here/triangle.bin"
    write_gltf_extras(source, source.parent / "tuned.gltf", DOCUMENT)
    assert json.loads((source.parent / "tuned.gltf").read_text())["buffers"][0]["uri"] == "triangle.bin"
    assert len(read_scene(source.parent / "tuned.gltf").meshes) == 1
    assert read_config(source.parent / "tuned.gltf") == CONFIG


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.obj", b"", "written into a .gltf or .glb file, got '.obj'"),
        ("a.glb", b"glTF", "GLB header: must be at least 20 bytes"),
        (
            "a.glb",
            b"glTF" + struct.pack("<IIII", 2, 20, 10**6, 0x4E4F534A),
            "first chunk must be JSON, and whole",
        ),
        ("a.gltf", b"{", "not JSON"),
        ("a.gltf", b"[]", "not a glTF document"),
        ("a.gltf", b'{"scenes": [1]}', "scenes: must be a list of objects"),
        ("a.gltf", b'{"buffers": [{"uri": 1}]}', "buffers: uri must be a string"),
    ],
)
def test_what_is_no_gltf_is_refused_and_nothing_written(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        write_gltf_extras(tmp_path / name, tmp_path / "out" / name, DOCUMENT)
    assert not (tmp_path / "out").exists()


def test_a_scene_without_a_config_and_one_with_a_bad_one(tmp_path):
    with pytest.raises(InputError, match="holds no extras.vpltune"):
        read_config(SCENES / "cornell-box.glb")
    write_gltf_extras(SCENES / "cornell-box.glb", tmp_path / "bad.glb", {**DOCUMENT, "version": 3})
    with pytest.raises(InputError, match="bad.glb: key 'version' is 3"):
        read_config(tmp_path / "bad.glb")
    assert read_gltf_extras(tmp_path / "bad.glb")["version"] == 3


def test_an_older_config_in_a_scene_is_read(tmp_path):
    write_gltf_extras(SCENES / "cornell-box.glb", tmp_path / "older.glb", older_document(visibility="none"))
    older = {"visibility": "transmittance", "quality": OLDER_QUALITY, "light": ONE_BOUNCE}
    assert read_config(tmp_path / "older.glb") == TunedConfig(point_vpls(), **older)


def _gltf_triangle(folder):
    """A .gltf whose buffer is a file beside it."""
    folder.mkdir()
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    (folder / "triangle.bin").write_bytes(corners.tobytes())
    root = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 3,
                "type": "VEC3",
                "min": [0, 0, 0],
                "max": [1, 1, 0],
            }
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": "triangle.bin", "byteLength": 36}],
    }
    (folder / "triangle.gltf").write_text(json.dumps(root))
    return folder / "triangle.gltf"


def _glb_json(path):
    content = path.read_bytes()
    return json.loads(content[20 : 20 + struct.unpack_from("<I", content, 12)[0]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"asset": {"version": "2.0"}, "x": NaN}', "x: NaN is not a JSON number"),
        ('{"asset": {"version": "2.0"}, "x": -Infinity}', "-Infinity is not a JSON number"),
        ('{"asset": {"version": "2.0"}, "x": 1e999}', "x: number 1e999 is too large"),
        ('{"asset": {}, "buffers": [{"uri": "a%00.bin"}]}', r"uri 'a%00\.bin' names no file"),
        ('{"asset": {}, "buffers": [{"uri": "\\ud800.bin"}]}', r"uri '\\ud800\.bin' names no file"),
        ('{"asset": {}, "images": [{"uri": "\\udc80.png"}]}', r"uri '\\udc80\.png' names no file"),
    ],
)
def test_what_is_no_json_or_names_no_file_is_refused(tmp_path, text, message):
    scene = tmp_path / "scene.gltf"
    scene.write_text(text)
    with pytest.raises(InputError, match=message) as refusal:
        write_gltf_extras(scene, tmp_path / "tuned.gltf", DOCUMENT)
    assert str(refusal.value).startswith(f"{scene}: ")
    assert not (tmp_path / "tuned.gltf").exists()
