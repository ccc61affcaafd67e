"""Which files count as scenes of a library, and what the key of a scene depends on."""

import os
import struct
import time
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image
from reading_cost import BATCH, check_cost
from scene_paths import OUTSIDE_SCENES

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import LightSettings
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, config_text
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.placement.given_sky import GivenSky
from vpltune.tuner.batch.job import Job, JobOptions
from vpltune.tuner.batch.job_key import SceneInputs, job_key
from vpltune.tuner.batch.referred_files import referred_files
from vpltune.tuner.batch.scene_files import library_scenes

XML = b'<?xml version="1.0"?><scene version="3.0.0"><string name="filename" value="parts/a.obj"/></scene>'


def library_of(folder, **files):
    for name, content in files.items():
        path = folder / name.replace("__", "/").replace("_", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder


def test_scenes_below_a_folder_are_found_and_parts_of_others_are_not(tmp_path):
    library_of(
        tmp_path,
        b_glb=b"",
        deep__er__a_PLY=b"",
        mitsuba__scene_xml=XML,
        mitsuba__parts__a_obj=b"",
        mitsuba__parts__b_obj=b"",
        other_xml=b"<project/>",
        out__old_glb=b"",
        readme_txt=b"",
    )
    (tmp_path / ".hidden").mkdir()
    (tmp_path / ".hidden" / "c.glb").touch()
    found = library_scenes(tmp_path, leave_out=tmp_path / "out")
    assert list(found) == ["b.glb", "deep/er/a.PLY", "mitsuba/parts/b.obj", "mitsuba/scene.xml"]
    assert found["deep/er/a.PLY"] == tmp_path / "deep/er/a.PLY"


def test_a_list_names_scenes_relative_to_itself(tmp_path):
    listing = tmp_path / "list.txt"
    listing.write_text("# mine\n\nrooms/a.glb\n/elsewhere/b.obj\n")
    found = library_scenes(listing, leave_out=tmp_path)
    assert found == {"rooms/a.glb": tmp_path / "rooms/a.glb", "/elsewhere/b.obj": Path("/elsewhere/b.obj")}


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"# nothing\n", "names no scene"), (b"\xff\xfe\x00", "not UTF-8 text")],
)
def test_a_list_that_is_none_is_refused(tmp_path, content, message):
    (tmp_path / "list.txt").write_bytes(content)
    with pytest.raises(InputError, match=message):
        library_scenes(tmp_path / "list.txt", leave_out=tmp_path)


@pytest.fixture
def opened(monkeypatch):
    """Takes the resolved path of each file that a reader opens."""
    paths = []
    read = SceneFolder._read

    def spy(self, path, subject):
        paths.append(Path(path).resolve())
        return read(self, path, subject)

    monkeypatch.setattr(SceneFolder, "_read", spy)
    return paths


@pytest.mark.parametrize("name", OUTSIDE_SCENES)
def test_every_file_that_a_reader_opens_is_named(scenes_folder, opened, name):
    """Otherwise a change to such a file would not trigger another fit."""
    scene = scenes_folder / name / OUTSIDE_SCENES[name]
    read_scene(scene)
    named = {path.resolve() for path in referred_files(scene)}
    assert set(opened) - {scene.resolve()} <= named


OBJ = "v 0 0 0 1 1 1\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
PLY = (
    "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 3\n"
    "property float x\nproperty float y\nproperty float z\nproperty float s\nproperty float t\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0 0 0\n1 0 0 0 0\n0 1 0 0 0\n3 0 1 2\n"
)
MTL = "newmtl a\nmap_Kd t.png\n"


@pytest.mark.parametrize(
    ("scene", "texture", "files"),
    [
        ("a.obj", "tex#1.png", {"a.obj": f"mtllib a.mtl\n{OBJ}", "a.mtl": "newmtl a\nmap_Kd tex#1.png\n"}),
        ("a.obj", "t.png", {"a.obj": f"mtllib my lib.mtl # mine\n{OBJ}", "my lib.mtl": MTL}),
        (
            "a.obj",
            "t.png",
            {"a.obj": f"mtllib \\\na.mtl\n{OBJ}", "a.mtl": "newmtl a\nmap_Kd \\\n t.png # x\n"},
        ),
        ("a.obj", "t.png", {"a.obj": f"\ufeffmtllib a.mtl\n{OBJ}", "a.mtl": "\ufeff" + MTL}),
        (
            "a.obj",
            "t.png",
            {"a.obj": f"mtllib a.mtl\n{OBJ}".replace("\n", "\r"), "a.mtl": MTL.replace("\n", "\r")},
        ),
        ("a.obj", "t.png", {"a.obj": f"\x0bmtllib\x0ca.mtl\n{OBJ}", "a.mtl": "newmtl a\n MAP_kd\x0bt.png\n"}),
        ("a.ply", "t.png", {"a.ply": PLY}),
        ("a.ply", "t.png", {"a.ply": PLY.replace("comment", "  comment")}),
        ("a.ply", "t.png", {"a.ply": "\ufeff" + PLY.replace("\n", "\r")}),
    ],
    ids=["hash", "remark", "continued", "mark", "returns", "blanks", "ply", "ply blanks", "ply returns"],
)
def test_names_are_read_as_the_readers_do(tmp_path, opened, scene, texture, files):
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8", newline="")
    Image.new("RGB", (1, 1)).save(tmp_path / texture)
    assert read_scene(tmp_path / scene).textures
    assert {path.name for path in opened} == {*files, texture}
    assert {tmp_path / name for name in (*files, texture)} - {tmp_path / scene} <= {
        *referred_files(tmp_path / scene)
    }


def test_a_binary_file_named_gltf_is_looked_through(tmp_path):
    """The reader goes by content too."""
    text = b'{"images": [{"uri": "t.png"}]}  '
    header = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A)
    (tmp_path / "a.gltf").write_bytes(header + text)
    assert referred_files(tmp_path / "a.gltf") == (tmp_path / "t.png",)


def test_names_in_xml_are_read_with_either_quote_and_entities(tmp_path):
    (tmp_path / "a.xml").write_text(
        """<scene><string value='a.obj'/><string value="b &amp; c.ply"/></scene>"""
    )
    assert referred_files(tmp_path / "a.xml") == (tmp_path / "a.obj", tmp_path / "b & c.ply")


def test_search_paths_of_mitsuba_are_followed(tmp_path):
    """Mitsuba takes the last folder first, and then the scene's own; a default may name the file."""
    library_of(tmp_path, a__x_obj=b"", b__y_obj=b"")
    (tmp_path / "scene.xml").write_text(
        "<scene><path value='a'/><path value='b'/><path value='..'/><path value='absent'/>"
        "<default name='m' value='x.obj'/>"
        "<shape type='obj'><string name='filename' value='$m'/></shape></scene>"
    )
    expected = (tmp_path / "b" / "x.obj", tmp_path / "a" / "x.obj", tmp_path / "x.obj")
    assert referred_files(tmp_path / "scene.xml") == expected
    assert list(library_scenes(tmp_path, leave_out=tmp_path / "out")) == ["b/y.obj", "scene.xml"]
    before = digest(tmp_path / "scene.xml")
    (tmp_path / "b" / "x.obj").write_bytes(b"v 0 0 0")  # it goes before that of the folder a
    assert digest(tmp_path / "scene.xml") != before


def digest(scene):
    return SceneInputs(scene.parent / "absent").digest(scene)[0]


def test_the_key_follows_every_file_of_the_scene(tmp_path):
    """The scene itself, its .mtl file, a texture named there with options and spaces, and its sidecar."""
    scene = tmp_path / "a.obj"
    scene.write_text("mtllib my own.mtl\nv 0 0 0\n")
    (tmp_path / "my own.mtl").write_text("newmtl a\nmap_Kd -s 1 1 1 dark wood.png\n")
    seen = {digest(scene)}
    for name in ("dark wood.png", "a.vpltune.toml", "my own.mtl", "a.obj"):
        with (tmp_path / name).open("a") as file:
            file.write("#\n")
        seen.add(digest(scene))
    assert len(seen) == 5


def test_the_key_is_the_same_wherever_the_scene_lies(tmp_path):
    library_of(tmp_path, one__a_glb=b"same", two__b_glb=b"same", two__b_ply=b"same")
    assert digest(tmp_path / "one/a.glb") == digest(tmp_path / "two/b.glb") != digest(tmp_path / "two/b.ply")


def test_files_out_of_the_folder_and_devices_are_not_opened(tmp_path):
    scene = tmp_path / "in" / "a.gltf"
    scene.parent.mkdir()
    scene.write_text('{"buffers": [{"uri": "../b.bin"}, {"uri": "pipe"}], "images": [{"uri": "data:,x"}, 3]}')
    (tmp_path / "b.bin").touch()
    os.mkfifo(scene.parent / "pipe")
    assert referred_files(scene) == (scene.parent / "pipe",)
    assert digest(scene)


def test_digests_are_kept_until_a_file_changes(tmp_path, monkeypatch):
    scene = tmp_path / "a.glb"
    scene.write_bytes(b"one")
    long_ago = time.time() - 60
    # The ctime of a file cannot be set back, so move the clock forward.
    monkeypatch.setattr(time, "time_ns", lambda: int((long_ago + 120) * 1e9))
    inputs = SceneInputs(tmp_path)
    first = inputs.digest(scene)
    inputs.save()
    hashed = []
    monkeypatch.setattr(
        "vpltune.tuner.batch.job_key._file_digest", lambda path: hashed.append(path.name) or "changed"
    )
    assert SceneInputs(tmp_path).digest(scene) == first
    assert not hashed
    (tmp_path / "a.vpltune.toml").touch()
    assert SceneInputs(tmp_path).digest(scene) != first
    assert hashed == ["a.glb", "a.vpltune.toml"]
    (tmp_path / "inputs.json").write_text("{")
    assert SceneInputs(tmp_path).digest(scene)


def test_a_file_just_changed_is_not_trusted(tmp_path):
    """It could change again within the same clock tick and keep its timestamp."""
    (tmp_path / "a.glb").write_bytes(b"one")
    inputs = SceneInputs(tmp_path)
    inputs.digest(tmp_path / "a.glb")
    inputs.save()
    assert not (tmp_path / "inputs.json").exists()


def test_the_key_follows_options_but_not_where_the_start_came_from(tmp_path):
    plain = JobOptions(start=config_text(TunedConfig()))
    sourced = replace(plain, start=config_text(TunedConfig(provenance={"scene": "other"})))
    assert job_key("d", plain) == job_key("d", sourced)
    others = [
        replace(plain, views=3),
        replace(plain, seed=1),
        replace(plain, size=(64, 48)),
        replace(plain, start=config_text(TunedConfig(visibility="transmittance"))),
        replace(plain, start=config_text(TunedConfig(ArtistParameters(lloyd_iterations=0)))),
        replace(plain, start=config_text(TunedConfig(quality=Quality(interleave=4)))),
        replace(plain, start=config_text(TunedConfig(quality=Quality(map_size=8)))),
        replace(plain, start=config_text(TunedConfig(quality=Quality(map_refinement=1)))),
        replace(plain, start=config_text(TunedConfig(quality=Quality(rsm_resolution=256)))),
        replace(plain, start=config_text(TunedConfig(light=LightSettings(1)))),
        replace(plain, sky=(1.0, 1.0, 1.0)),
        replace(plain, environment=str(tmp_path / "absent.exr")),
    ]
    assert len({job_key("d", options) for options in [plain, *others]} | {job_key("e", plain)}) == 14


def test_the_key_follows_what_is_in_an_environment(tmp_path):
    plain = JobOptions(start=config_text(TunedConfig()))
    contents = {"a.hdr": b"one", "b.hdr": b"two", "c.hdr": b"one"}
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    first, second, third = (
        job_key("d", replace(plain, environment=str(tmp_path / name))) for name in contents
    )
    assert first == third != second


def test_the_environment_of_a_sidecar_is_referred_to(tmp_path):
    (tmp_path / "a.vpltune.toml").write_text('[sky]\nenvironment = "maps/sky.hdr"\n')
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n")
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Ke glow.png\nmap_d holes.png\n")
    names = ("a.mtl", "glow.png", "holes.png", "maps/sky.hdr")
    assert referred_files(tmp_path / "a.obj") == tuple(tmp_path / name for name in names)
    (tmp_path / "a.vpltune.toml").write_text('[sky]\nenvironment = "../sky.hdr"\n')
    assert len(referred_files(tmp_path / "a.obj")) == 3


def test_jobs_carry_their_sky(tmp_path):
    options = JobOptions(start=config_text(TunedConfig()), sky=(1.0, 2.0, 3.0), size=(8, 6))
    job = Job("k", "scene.glb", "scene", str(tmp_path), options)
    assert Job.from_json(job.to_json()) == job
    assert job.options.fit_options(None).sky == GivenSky((1.0, 2.0, 3.0))
    there = replace(options, sky=None, environment="/sky.exr")
    assert there.fit_options(None).sky == GivenSky(file="/sky.exr")
    assert replace(options, sky=None).fit_options(None).sky is None


def test_scenes_of_others_are_found_and_what_is_left_is_mitsubas(scenes_folder, tmp_path):
    """The meshes of Mitsuba scenes, 80 OBJ files, do not count as scenes."""
    found = set(library_scenes(scenes_folder, leave_out=tmp_path))
    tuned = {f"{folder}/{file}" for folder, file in OUTSIDE_SCENES.items()}
    assert tuned < found
    assert {Path(name).name for name in found - tuned} == {"scene.xml"}


@pytest.mark.parametrize(
    ("obj", "mtl"),
    [
        ("mtllib scene.mtl\n", "newmtl a\nmap_Kd" + " a" * 200_000 + "\n"),
        ("mtllib scene.mtl\n", "newmtl a\n" + "map_Kd a b c.png\n" * 200_000),
        ("".join(f"mtllib a{i}\n" for i in range(200_000)), ""),
        ("mtllib" + " scene.mtl" * 200_000 + "\n", "newmtl a\nmap_Kd a.png\n" * 1000),
    ],
    ids=["words", "lines", "libraries", "one library"],
)
def test_looking_for_files_takes_time_by_the_byte(tmp_path, obj, mtl):
    """It happens before the limits of a fit begin."""
    (tmp_path / "scene.obj").write_text(obj)
    (tmp_path / "scene.mtl").write_text(mtl)
    check_cost(tmp_path / "scene.obj", BATCH)
