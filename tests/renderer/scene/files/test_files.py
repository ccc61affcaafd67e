"""Files: containers are parsed, and only regular files in the scene's folder are opened."""

import json
import os
import struct

import pytest

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene


def test_gltf_and_glb_say_the_same(triangle):
    for path in (triangle.write("a.gltf"), triangle.write("b.glb")):
        scene = read_scene(path)
        assert scene.name == path.stem
        assert scene.triangle_count() == 1


@pytest.mark.parametrize("name", ["scene.GLTF", "scene.Glb"])
def test_suffixes_in_capitals(triangle, name):
    triangle.write(f"plain{name[5:].lower()}").rename(triangle.folder / name)
    assert read_scene(triangle.folder / name).triangle_count() == 1


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda b: b[:1], "at least 20 bytes, got 1"),
        (lambda b: b[:-1], "says .* bytes, but the file is cut off after"),
        (lambda b: b"glTG" + b[4:], "must begin with 'glTF'"),
        (lambda b: b[:4] + struct.pack("<I", 3) + b[8:], "version must be 2, got 3"),
        (
            lambda b: b[:12] + struct.pack("<I", 2**32 - 1) + b[16:],
            "GLB chunk at byte 12: says 4294967295 bytes",
        ),
        (lambda b: b[:16] + b"BIN\0" + b[20:], "first chunk must be JSON"),
        (lambda b: b"", "is empty"),
    ],
)
def test_broken_glb_containers_are_refused(triangle, edit, message):
    path = triangle.write("scene.glb")
    path.write_bytes(edit(path.read_bytes()))
    with pytest.raises(InputError, match=message):
        read_scene(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("[]", "the document: must be an object"),
        ('{"asset"', "is not JSON"),
        ('{"asset": {"version": "2.0"}, "scene": NaN}', "scene: NaN is not a JSON number"),
        ('{"nodes": [{}, {"scale": [1.5, 1, -Infinity]}]}', r"nodes\[1\]\.scale\[2\]: -Infinity is not"),
        (
            '{"nodes": [{}, {"extras": {"a b": [[1e999, NaN]]}}]}',
            r"\.extras\['a b'\]\[0\]\[0\]: number",
        ),
        ('{"scene": 1e999, "nodes":', "the document: number 1e999 is too large"),
        ('{"asset": {"version": "2.0"}, "scene": 0, "scene": 1}', "key 'scene' appears twice in one object"),
        ('{"asset": {"version": "1.0"}}', "asset.version: only glTF 2.0 is read, got '1.0'"),
        ('{"asset": {"version": "2.1", "minVersion": "2.1"}}', "only glTF 2.0 is read"),
        ("{}", "key 'asset' is missing"),
        ("[" * 100_000, "nested too deep"),
        ('{"asset": {"version": "2.0"}, "nodes": {}}', "nodes: must be a list"),
        ('{"asset": {"version": "2.0"}, "nodes": [3]}', r"nodes\[0\]: must be an object, got 3"),
    ],
)
def test_broken_json_is_refused(tmp_path, text, message):
    path = tmp_path / "scene.gltf"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_scene(path)


def test_a_byte_order_mark_is_passed_over(triangle):
    path = triangle.write()
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_scene(path).triangle_count() == 1


@pytest.mark.parametrize(
    "uri",
    [
        "../secret.bin",
        "..%2Fsecret.bin",
        "sub/../../secret.bin",
        "/etc/passwd",
        "/dev/zero",
        "file:///etc/passwd",
        "http://127.0.0.1/x.bin",
        "~/secret.bin",
        "",
        ".",
        "a\0b",
        "a" * 70_000,
        "link_out.bin",
        "fifo.bin",
        "loop.bin",
        "nope\n.bin",
        "data:;base64,@@@@",
        "data:nothing",
    ],
)
def test_only_regular_files_in_the_scenes_folder_are_opened(triangle, tmp_path, uri):
    folder = tmp_path / "scene"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(bytes(36))
    (folder / "link_out.bin").symlink_to(tmp_path / "secret.bin")
    (folder / "loop.bin").symlink_to(folder / "loop.bin")
    os.mkfifo(folder / "fifo.bin")
    path = folder / "scene.gltf"
    path.write_text(json.dumps(triangle.document | {"buffers": [{"byteLength": 36, "uri": uri}]}))
    with pytest.raises(InputError, match=r"scene\.gltf: buffers\[0\]\.uri: ") as refused:
        read_scene(path)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 1000


def test_files_in_folders_below_and_links_within_are_read(triangle):
    written = triangle.write()
    (triangle.folder / "below").mkdir()
    (triangle.folder / "scene.bin").rename(triangle.folder / "below" / "a b%.bin")
    (triangle.folder / "link.bin").symlink_to(triangle.folder / "below" / "a b%.bin")
    for uri in ("below/a%20b%25.bin", "below/a b%.bin", "below/../link.bin"):
        written.write_text(json.dumps(triangle.document | {"buffers": [{"byteLength": 36, "uri": uri}]}))
        assert read_scene(written).triangle_count() == 1


def test_a_scene_may_itself_be_a_link(triangle, tmp_path):
    path = triangle.write("scene.glb")
    link = tmp_path / "elsewhere.glb"
    link.symlink_to(path)
    assert read_scene(link).triangle_count() == 1


def test_a_buffer_shorter_than_it_says_is_refused(triangle):
    path = triangle.write()
    (triangle.folder / "scene.bin").write_bytes(bytes(35))
    with pytest.raises(InputError, match=r"buffers\[0\]\.byteLength: says 36, but there are 35 bytes"):
        read_scene(path)


@pytest.mark.parametrize("name", ["scene.stl", "scene", "scene.gltf.zip"])
def test_other_formats_are_refused_with_the_list_of_ours(tmp_path, name):
    (tmp_path / name).write_text("x")
    with pytest.raises(InputError, match=r"must be one of \.gltf, \.glb, \.obj, \.ply"):
        read_scene(tmp_path / name)


def test_mitsuba_xml_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match="Mitsuba XML is not read directly; convert it to a .glb"):
        read_scene(tmp_path / "scene.xml")


@pytest.mark.parametrize("suffix", [".gltf", ".glb", ".obj", ".ply"])
def test_what_is_no_file_is_refused(tmp_path, suffix):
    path = tmp_path / f"scene{suffix}"
    makers = {
        "No such file": lambda: None,
        "is not a regular file": path.mkdir,
        "Too many levels of symbolic links": lambda: path.symlink_to(path),
        "not a regular file": lambda: path.symlink_to("/dev/zero"),
        "a regular file": lambda: os.mkfifo(path),
    }
    for message, make in makers.items():
        make()
        with pytest.raises(InputError, match=message):
            read_scene(path)
        if path.is_dir():
            path.rmdir()
        else:
            path.unlink(missing_ok=True)


def test_names_with_line_breaks_stay_on_one_line(triangle):
    triangle.node["name"] = "two\nlines\x1b[31m" + "x" * 10_000
    path = triangle.write("odd\nname.gltf")
    (instance,) = read_scene(path).instances
    assert instance.name.isprintable()
    assert len(instance.name) <= 80
    triangle.node["mesh"] = "a\nb"
    with pytest.raises(InputError) as refused:
        read_scene(triangle.write("odd\nname.gltf"))
    assert "\n" not in str(refused.value)
