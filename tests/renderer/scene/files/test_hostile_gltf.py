"""Small glTF files that ask for much: work stays linear in the file, and what goes wrong is one line."""

import base64
import copy
import json
import tracemalloc

import numpy as np
import pytest
from PIL import Image
from reading_cost import check_cost

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import (
    gltf_deformation,
    gltf_scene,
    limited_decoder,
    read_scene,
    scene_reader,
)

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
UP = np.tile(np.array([0, 0, 1], np.float32), (3, 1))


class TestDraco:
    def write(self, gltf, stream):
        gltf.add("accessors", {"componentType": 5126, "count": 3, "type": "VEC3"})
        gltf.add("accessors", {"componentType": 5125, "count": 3, "type": "SCALAR"})
        extension = {"bufferView": gltf.view(stream), "attributes": {"POSITION": 0}}
        primitive = {"attributes": {"POSITION": 0}, "indices": 1}
        primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
        gltf.document["meshes"][0]["primitives"] = [primitive]
        return gltf.write("scene.glb")

    # A point cloud of 1.4e9 points, and a mesh of as many faces and points, each in 82 bytes or fewer.
    @pytest.mark.parametrize(
        "stream",
        [
            base64.b64decode("RFJBQ08CAgAAAAAATnJTAQEACQMA") + bytes(60),
            b"DRACO\x02\x02\x01\x00\x00\x00" + b"\xff\xff\xff\x2f" * 2 + b"\x01" + bytes(40),
            b"DRACO\x02\x02\x01\x01\x00\x00\x00" + b"\xff\xff\xff\x2f" * 2 + b"\x01" + bytes(40),
        ],
    )
    def test_a_bitstream_that_announces_much_is_refused(self, gltf, stream):
        assert "Draco cannot decode it" in check_cost(self.write(gltf, stream))

    def test_the_decoder_is_limited_in_memory(self, gltf):
        path = self.write(gltf, base64.b64decode("RFJBQ08CAgAAAAAATnJTAQEACQMA") + bytes(60))
        with pytest.raises(InputError, match="it needs more than 1024 MiB"):
            read_scene(path)

    @pytest.mark.parametrize(
        ("fault", "cause"),
        [
            (
                "import resource; resource.setrlimit(resource.RLIMIT_CPU, (1, 2))\nwhile True: pass",
                "it took more than 1 s",
            ),
            ("os.kill(os.getpid(), signal.SIGSEGV)", "the decoder was ended by SIGSEGV"),
            ("os.kill(os.getpid(), signal.SIGKILL)", "the decoder was ended by SIGKILL"),
            ("os._exit(3)", "the decoder ended with exit code 3"),
            # Halfway: three faces are announced, and no array follows.
            (
                """print('{"arrays": [["<u4", [3]], ["<f4", [3, 3]]], "ids": [0]}', flush=True)""",
                "the decoder ended with exit code 0",
            ),
        ],
    )
    def test_the_end_of_the_decoder_is_told_by_its_cause(self, gltf, tmp_path, monkeypatch, fault, cause):
        program = tmp_path / "program.py"
        program.write_text(f"import os, signal, sys\nsys.stdin.buffer.readline()\n{fault}\n")
        monkeypatch.setattr(limited_decoder, "_PROGRAM", program)
        with pytest.raises(InputError, match=rf"Draco cannot decode it \({cause}\)"):
            read_scene(self.write(gltf, b"DRACO"))


class TestWork:
    def test_many_nodes_on_one_large_skin(self, triangle):
        count = 2000
        triangle.document["nodes"] = [{"mesh": 0, "skin": 0}] * count + [{"translation": [0, 0, 0]}] * count
        triangle.document["skins"] = [{"joints": list(range(count, 2 * count))}]
        triangle.document["scenes"] = [{"nodes": list(range(2 * count))}]
        path = triangle.write()
        assert not check_cost(path)
        scene = read_scene(path)
        assert len(scene.instances) == count
        assert len(scene.meshes) == 1

    def test_many_nodes_with_one_of_many_lights(self, triangle):
        count = 3000
        light = {"type": "point"}
        triangle.document["extensions"] = {"KHR_lights_punctual": {"lights": [light] * count}}
        shining = {"extensions": {"KHR_lights_punctual": {"light": count - 1}}}
        triangle.document["nodes"] += [shining] * count
        triangle.document["scenes"] = [{"nodes": list(range(count + 1))}]
        path = triangle.write()
        assert not check_cost(path)
        scene = read_scene(path)
        assert len(scene.lights) == count

    def test_many_nodes_on_a_mesh_of_many_points(self, triangle):
        count = 3000
        triangle.document["meshes"].append({"primitives": [{"attributes": {}, "mode": 0}] * count})
        triangle.document["nodes"] += [{"mesh": 1}] * count
        triangle.document["scenes"] = [{"nodes": list(range(count + 1))}]
        path = triangle.write()
        assert not check_cost(path)
        scene = read_scene(path)
        assert len(scene.instances) == 1

    def test_many_channels_with_many_samplers(self, triangle):
        count = 1500
        times = triangle.accessor(np.array([0, 1], np.float32))
        values = triangle.accessor(np.array([[0, 0, 0], [1, 0, 0]], np.float32))
        channel = {"sampler": count - 1, "target": {"node": 0, "path": "translation"}}
        sampler = {"input": times, "output": values}
        triangle.document["animations"] = [{"channels": [channel] * count, "samplers": [sampler] * count}]
        path = triangle.write()
        assert not check_cost(path)
        scene = read_scene(path)
        assert len(scene.animation.channels) == 1

    def test_many_morph_targets_of_one_accessor(self, gltf):
        # 6,000 targets of 30,000 vertices are 2 GiB of displacements in a file of half a megabyte.
        positions = np.random.default_rng(0).random((30_000, 3)).astype(np.float32)
        primitive = gltf.add_primitive(positions)
        primitive["targets"] = [{"POSITION": gltf.accessor(positions)}] * 6000
        assert "morph targets must take at most 512 MiB" in check_cost(gltf.write())

    @pytest.mark.parametrize(
        ("node", "limit", "what"),
        [
            ({"camera": 0}, "MAX_CAMERAS", "cameras"),
            ({"extensions": {"KHR_lights_punctual": {"light": 0}}}, "MAX_LIGHTS", "lights"),
            ({"mesh": 0, "scale": [0, 0, 1]}, "MAX_INSTANCES", "primitives"),
        ],
    )
    def test_too_many_of_a_kind_are_refused(self, triangle, monkeypatch, node, limit, what):
        monkeypatch.setattr(gltf_scene, limit, 100)
        perspective = {"yfov": 1.0, "znear": 0.1}
        triangle.document["cameras"] = [{"type": "perspective", "perspective": perspective}]
        triangle.document["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
        triangle.document["nodes"] += [node] * 101
        triangle.document["scenes"] = [{"nodes": list(range(102))}]
        with pytest.raises(InputError, match=f"nodes: must place at most 100 {what} in all"):
            read_scene(triangle.write())

    def test_a_flat_mesh_that_is_too_large_is_refused_by_its_count(self, triangle):
        count = 27_000_000
        indices = {"componentType": 5121, "count": count, "type": "SCALAR"}
        triangle.primitive["indices"] = triangle.add("accessors", indices)
        path = triangle.write()
        tracemalloc.start()
        with pytest.raises(InputError, match="geometry must take at most 512 MiB once decoded"):
            read_scene(path)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < count  # not even the indices, of a byte each

    def test_many_instances_of_a_large_mesh_take_the_memory_of_one(self, gltf):
        """Their corners in the world are 288 MB together; the file and its mesh need less than 5 MB."""
        points, instances = 60_000, 200
        gltf.add_primitive(np.random.default_rng(3).random((points, 3)).astype(np.float32))
        gltf.document["nodes"] *= instances
        gltf.document["scenes"] = [{"nodes": list(range(instances))}]
        path = gltf.write()
        tracemalloc.start()
        assert len(read_scene(path).instances) == instances
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 0.1 * instances * points * 3 * 8

    def test_json_text_of_wide_characters_is_limited(self, tmp_path):
        path = tmp_path / "scene.gltf"
        path.write_text(json.dumps({"asset": {"version": "2.0"}}) + " " * (1 << 25) + "\U0001f600")
        with pytest.raises(InputError, match="JSON must take at most 128 MiB as text, got 129 MiB"):
            read_scene(path)


class TestOneLine:
    @pytest.mark.parametrize(
        "uri", ["\ud800.bin", "a\udc80", "data:,\ud800", "data:;base64,\udfff", "%ED%A0%80"]
    )
    def test_uris_that_are_no_text(self, triangle, uri):
        triangle.document["buffers"] = [{"byteLength": 36, "uri": uri}]
        with pytest.raises(InputError, match=r"scene\.gltf: buffers\[0\]\.uri: "):
            read_scene(triangle.write())

    @pytest.mark.parametrize(
        ("error", "cause"),
        [
            (TypeError("x"), r"cannot be read \(TypeError: x\)"),
            (OverflowError("x"), r"cannot be read \(OverflowError: x\)"),
            (RecursionError("x"), "references are nested too deep"),
            (MemoryError("x"), "does not fit into memory"),
            (UnicodeError("x"), r"cannot be read \(UnicodeError: x\)"),
            (KeyError("x"), r"cannot be read \(KeyError: 'x'\)"),
            (AssertionError(), r"cannot be read \(AssertionError: \)"),
        ],
    )
    def test_whatever_a_library_raises(self, triangle, monkeypatch, error, cause):
        def broken(*_):
            raise error

        monkeypatch.setattr(scene_reader, "_reader_for", lambda _: broken)
        with pytest.raises(InputError, match=rf"scene\.gltf: {cause}$"):
            read_scene(triangle.write())

    @pytest.mark.parametrize("apart", [11, pytest.param(6, marks=pytest.mark.slow)])
    def test_every_value_of_a_wrong_type(self, gltf, apart):
        """A file that uses all that is read, with each of its values in turn replaced by wrong ones."""
        everything(gltf)
        path = gltf.write()
        assert read_scene(path).triangle_count() > 0
        whole = json.loads(path.read_text())
        refused = 0
        wrongs = (None, -1, 1e30, "\ud800%00", [], {}, [[None]], {"": {"x": None}}, 10**400, "", True)
        for index, place in enumerate(places(whole)):
            # One or two of them each, to save time: the keys of most objects occur several times.
            for wrong in wrongs[index % apart :: apart]:
                path.write_text(json.dumps(replaced(whole, place, wrong)))
                try:
                    read_scene(path)
                except InputError as error:
                    refused += 1
                    assert "cannot be read (" not in str(error), (place, wrong)
        assert refused > 100


class TestMorphTargets:
    @pytest.mark.parametrize("semantic", ["POSITION", "NORMAL"])
    @pytest.mark.parametrize("weights", [{}, {"weights": [0]}, {"weights": [1]}])
    def test_nan_is_refused_whatever_the_weight(self, gltf, semantic, weights):
        bad = UP.copy()
        bad[1, 2] = np.nan
        gltf.add_primitive(NORMAL=UP)["targets"] = [{semantic: gltf.accessor(bad)}]
        gltf.document["meshes"][0] |= weights
        with pytest.raises(InputError, match=r"accessors\[0\]: must be finite, got \[0.0, 0.0, nan\]"):
            read_scene(gltf.write())

    @pytest.mark.parametrize(("semantic", "what"), [("POSITION", "positions"), ("NORMAL", "normals")])
    def test_overflow_is_refused(self, gltf, semantic, what):
        gltf.add_primitive(NORMAL=UP)["targets"] = [{semantic: gltf.accessor(1e30 * UP)}]
        gltf.document["meshes"][0]["weights"] = [1e29]
        with pytest.raises(InputError, match=f"{what} must be finite and at most"):
            read_scene(gltf.write())


def test_a_large_skin_is_read_in_chunks(gltf, monkeypatch):
    """The same numbers as in one piece."""
    rng = np.random.default_rng(4)
    joints = rng.integers(0, 2, (30, 4)).astype(np.uint8)
    weights, normals = rng.random((30, 4)).astype(np.float32), rng.normal(size=(30, 3)).astype(np.float32)
    positions = rng.random((30, 3)).astype(np.float32)
    gltf.add_primitive(positions, NORMAL=normals, JOINTS_0=joints, WEIGHTS_0=weights)
    gltf.document["nodes"] += [{}, {"rotation": [0, 0, 1, 0], "scale": [1, 2, 3]}]
    gltf.document["skins"] = [{"joints": [1, 2]}]
    gltf.node["skin"] = 0
    path = gltf.write()
    (whole,) = read_scene(path).meshes
    monkeypatch.setattr(gltf_deformation, "VERTEX_CHUNK", 7)
    (pieces,) = read_scene(path).meshes
    np.testing.assert_array_equal(pieces.positions, whole.positions)
    np.testing.assert_array_equal(pieces.normals, whole.normals)


@pytest.mark.parametrize(
    ("size", "outcome"),
    [
        (1e13, r"positions must be finite and at most 1e\+12 in magnitude"),
        (1e-13, r"must be at least 1e-12 across, got 1.4\d*e-13"),
        (1e11, None),
        (1e-10, None),
    ],
)
def test_the_range_of_sizes(gltf, size, outcome):
    gltf.add_primitive(TRIANGLE * np.float32(size))
    path = gltf.write()
    if outcome is None:
        assert not read_scene(path).warnings
    else:
        with pytest.raises(InputError, match=outcome):
            read_scene(path)


def everything(gltf):
    """A document with an object of every kind that the reader takes up."""
    joints, weights = np.zeros((3, 4), np.uint8), np.tile(np.array([1, 0, 0, 0], np.float32), (3, 1))
    uv, colors = np.zeros((3, 2), np.float32), np.ones((3, 3), np.float32)
    gltf.add_primitive(
        indices=np.arange(3, dtype=np.uint16),
        NORMAL=UP,
        TEXCOORD_0=uv,
        COLOR_0=colors,
        JOINTS_0=joints,
        WEIGHTS_0=weights,
    )
    info = {"extensions": {"KHR_texture_transform": {"offset": [0, 0], "scale": [1, 1], "rotation": 0}}}
    texture = gltf.add_base_color_image(Image.new("RGB", (2, 2)), texCoord=0, **info)
    texture["sampler"] = gltf.add("samplers", {"wrapS": 33071, "magFilter": 9728})
    gltf.document["materials"][0] |= {"name": "m", "emissiveFactor": [0, 0, 0], "alphaMode": "OPAQUE"}
    gltf.primitive["targets"] = [{"POSITION": gltf.accessor(UP), "NORMAL": gltf.accessor(UP)}]
    gltf.document["meshes"][0] |= {"weights": [0.5], "name": "mesh"}
    sparse = {"count": 1, "indices": {"bufferView": gltf.view(b"\0"), "componentType": 5121}}
    sparse["values"] = {"bufferView": gltf.view(bytes(12))}
    gltf.document["accessors"][0] |= {"sparse": sparse, "normalized": False, "byteOffset": 0}
    matrices = np.eye(4, dtype=np.float32).reshape(1, 16)
    gltf.add("skins", {"joints": [1], "inverseBindMatrices": gltf.accessor(matrices)})
    gltf.node["skin"] = 0
    placing = {
        "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": gltf.accessor(np.zeros((2, 3), "f4"))}}
    }
    gltf.document["nodes"] += [
        {"name": "joint", "translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]},
        {"mesh": 0, "extensions": placing | {"KHR_node_visibility": {"visible": True}}, "children": [3]},
        {
            "camera": 0,
            "extensions": {"KHR_lights_punctual": {"light": 0}},
            "matrix": np.eye(4).ravel().tolist(),
        },
    ]
    gltf.document["scenes"] = [{"nodes": [0, 1, 2]}]
    gltf.document["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]
    spot = {"innerConeAngle": 0.1, "outerConeAngle": 0.5}
    light = {"type": "spot", "color": [1, 1, 1], "intensity": 3, "range": 2, "spot": spot, "name": "l"}
    gltf.document["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    gltf.document["extensionsUsed"] = ["KHR_lights_punctual"]
    times = gltf.accessor(np.array([0, 1], np.float32))
    sampler = {
        "input": times,
        "output": gltf.accessor(np.zeros((2, 3), np.float32)),
        "interpolation": "LINEAR",
    }
    channel = {"sampler": 0, "target": {"node": 1, "path": "translation"}}
    gltf.document["animations"] = [{"channels": [channel], "samplers": [sampler]}]
    return gltf.document


def places(value, at=()):
    """The paths of all members of a JSON document."""
    members = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    for key, member in members:
        yield (*at, key)
        yield from places(member, (*at, key))


def replaced(document, place, value):
    changed = copy.deepcopy(document)
    holder = changed
    for key in place[:-1]:
        holder = holder[key]
    holder[place[-1]] = value
    return changed
