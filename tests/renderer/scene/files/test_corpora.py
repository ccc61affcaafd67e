"""Hundreds of hostile, odd and valid files: each gives a scene or one line, and never wrong geometry."""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[4]

# Runs in its own process, so that time and memory are the reader's own and a crash is noticed.
READ_ALL = """
import json, os, resource, sys, time, warnings
from pathlib import Path
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene
import vpltune.renderer.scene.files.gltf_scene, vpltune.renderer.scene.files.obj_scene
import vpltune.renderer.scene.files.ply_scene

warnings.simplefilter("error")
resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))
root = Path(sys.argv[1])
opened = []

def on_event(event, arguments):
    if event == "open" and isinstance(arguments[0], (str, bytes, os.PathLike)):
        opened.append(os.fsdecode(arguments[0]))
    elif event == "socket.connect":
        opened.append("a socket")

sys.addaudithook(on_event)
for name in json.load(sys.stdin):
    path = root / name
    opened.clear()
    start = time.process_time()
    outcome = {"name": name, "warnings": []}
    try:
        scene = read_scene(path)
        outcome |= {"triangles": scene.triangle_count(), "warnings": scene.warnings, "refusal": None}
    except InputError as error:
        outcome |= {"triangles": 0, "refusal": str(error)}
    outcome["seconds"] = time.process_time() - start
    folder = str(path.parent.resolve())
    # Python opens its own modules when they are first imported.
    outcome["opened_outside"] = [
        name for name in opened
        if not os.path.realpath(name).startswith(folder + os.sep)
        and not name.endswith((".py", ".pyc", ".so"))
    ]
    # VmHWM is for this process alone; ru_maxrss starts at the value of the parent.
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    outcome["peak_mib"] = int(status["VmHWM"].split()[0]) >> 10
    print(json.dumps(outcome))
"""

# Codes of the Khronos validator for errors that make a surface wrong or its data ambiguous.
BREAKS_GEOMETRY = {
    "ACCESSOR_INDEX_OOB",
    "ACCESSOR_INDEX_PRIMITIVE_RESTART",
    "ACCESSOR_INVALID_FLOAT",
    "ACCESSOR_JOINTS_INDEX_OOB",
    "ACCESSOR_SMALL_BYTESTRIDE",
    "ACCESSOR_SPARSE_COUNT_OUT_OF_RANGE",
    "ACCESSOR_TOO_LONG",
    "ARRAY_LENGTH_NOT_IN_LIST",
    "BUFFER_BYTE_LENGTH_MISMATCH",
    "BUFFER_MISSING_GLB_DATA",
    "BUFFER_VIEW_TOO_LONG",
    "GLB_CHUNK_TOO_BIG",
    "GLB_INVALID_VERSION",
    "GLB_LENGTH_MISMATCH",
    "GLB_UNEXPECTED_BIN_CHUNK",
    "GLB_UNEXPECTED_END_OF_CHUNK_DATA",
    "INVALID_INDEX",
    "MESH_PRIMITIVE_UNEQUAL_ACCESSOR_COUNT",
    "NODE_LOOP",
    "NODE_PARENT_OVERRIDE",
    "TYPE_MISMATCH",
    "UNKNOWN_ASSET_MAJOR_VERSION",
    "UNRESOLVED_REFERENCE",
    "VALUE_NOT_IN_RANGE",
}
# Broken only in parts that a still image of diffuse surfaces does not use, so they may be read.
READ_ALL_THE_SAME = {
    # A metallic factor that is a string.
    "assimp_gltf/test/models/glTF2/wrongTypes/badNumber.gltf",
    # Bytes after the end that the header declares.
    "handmade/scenes/glb_binchunk4g.glb",
}
# Valid, but rejected for a reason other than having no triangles.
VALID_BUT_REFUSED = {
    "handmade/scenes/json_1e6_nodes.gltf": "at most 2,000,000 JSON values",
    "handmade/scenes/json_deep_extras.gltf": "nested too deep",
    "validator/test/base/data/node/valid.gltf": "every vertex must have a weight above zero",
    "validator/test/base/data/root/named_objects.gltf": "has no uri, and the file has no binary chunk",
    "validator/test/base/data/skin/ignored_animated_transform.gltf": "every vertex must have a weight",
    "validator/test/base/data/skin/ignored_local_transform.gltf": "every vertex must have a weight",
}


@dataclass(frozen=True)
class Verdict:
    name: str
    khronos: str
    codes: frozenset[str]


@pytest.fixture(scope="module")
def verdicts(corpora_folder) -> list[Verdict]:
    rows = [line.split("\t") for line in (corpora_folder / "verdicts.tsv").read_text().splitlines()]
    return [Verdict(row[0], row[2].removeprefix("khronos="), frozenset(row[4].split(","))) for row in rows]


@pytest.fixture(scope="module")
def outcomes(corpora_folder, verdicts) -> dict[str, dict]:
    result = subprocess.run(
        [sys.executable, "-c", READ_ALL, str(corpora_folder)],
        input=json.dumps([verdict.name for verdict in verdicts]),
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""
    return {outcome["name"]: outcome for outcome in map(json.loads, result.stdout.splitlines())}


def test_every_file_gives_a_scene_or_one_line_that_names_it(outcomes, verdicts, corpora_folder):
    assert len(outcomes) == len(verdicts)
    for name, outcome in outcomes.items():
        if outcome["refusal"] is None:
            assert outcome["triangles"] > 0, name
        else:
            assert outcome["refusal"].startswith(f"{corpora_folder / name}: "), name
        for line in [outcome["refusal"] or "", *outcome["warnings"]]:
            assert line.isprintable(), name
            assert len(line) < 1000, name


def test_every_file_is_done_with_in_time_and_memory(outcomes):
    # Measured: at most 0.6 s per file, and 190 MiB for all.
    assert {name: o["seconds"] for name, o in outcomes.items() if o["seconds"] > 2.0} == {}
    assert max(o["peak_mib"] for o in outcomes.values()) < 1024


def test_nothing_is_opened_outside_the_scenes_folder(outcomes):
    assert {name: o["opened_outside"] for name, o in outcomes.items() if o["opened_outside"]} == {}


def test_broken_geometry_is_never_read(outcomes, verdicts):
    broken = [v for v in verdicts if v.codes & BREAKS_GEOMETRY and v.name not in READ_ALL_THE_SAME]
    assert len(broken) > 80
    read = {v.name: sorted(v.codes & BREAKS_GEOMETRY) for v in broken if outcomes[v.name]["refusal"] is None}
    assert read == {}


def test_valid_files_are_read_unless_they_hold_no_triangles(outcomes, verdicts):
    for verdict in verdicts:
        refusal = outcomes[verdict.name]["refusal"]
        if verdict.khronos == "clean" and refusal is not None:
            assert VALID_BUT_REFUSED.get(verdict.name, "has no triangles") in refusal
    assert sum(outcome["refusal"] is None for outcome in outcomes.values()) >= 175
