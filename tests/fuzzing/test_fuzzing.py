"""The readers survive some hundreds of changed files each, and the fuzzer catches a reader that does not."""

import contextlib
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.fuzzing.cases import READERS, Case, cases
from tests.fuzzing.outcomes import judged
from tests.fuzzing.run import kept_cases
from tests.fuzzing.tree_text import json_text, toml_text

REPOSITORY = Path(__file__).resolve().parents[2]
# A choice: 75 for each reader. `make fuzz` takes tens of thousands.
QUICK_CASES = 600
# Twice as many took 7 s on two cores alone, and 18 s where eight other processes shared them. These may take
# the latter, for a machine half as fast.
MOST_CPU_S = 18.0


def fuzzed(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own: forks of this one would inherit OpenGL and threads."""
    return python("-m", "tests.fuzzing.run", *arguments)


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def quick_run() -> tuple[subprocess.CompletedProcess[str], float]:
    """A run of the command, and its processor time in s, that of its forks included."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    result = fuzzed("--cases", str(QUICK_CASES), "--seed", "2")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return result, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_the_readers_survive_changed_files(quick_run):
    """Every case is read, or refused in one line."""
    result, spent = quick_run
    assert result.returncode == 0, result.stdout + result.stderr
    assert spent < MOST_CPU_S


def test_some_changed_files_are_read_and_some_refused(quick_run):
    """A twentieth at least of either, so that what stands behind the first check of a reader is reached."""
    rows = [line.split() for line in quick_run[0].stdout.splitlines()[1 : 1 + len(READERS)]]
    assert [row[0] for row in rows] == [*READERS]
    for _, read, refused, _ in rows:
        assert min(int(read), int(refused)) >= 0.05 * QUICK_CASES / len(READERS)


def test_what_failed_once_does_so_no_more():
    assert kept_cases()
    result = fuzzed("--kept")
    assert result.returncode == 0, result.stdout + result.stderr


FAULTS = {
    "raise TypeError('seeded')": "TypeError at ",
    "bytearray(2 << 30)": "MemoryError at ",
    "while True: pass": "more than 0.3 s and 3 µs a byte of processor time in ",
    "os.kill(os.getpid(), signal.SIGSEGV)": "SIGSEGV at ",
    "os._exit(3)": "exit with code 3 at ",
    "raise InputError(f'{path}: two\\nlines')": "message of several lines at ",
    "raise InputError('nothing is said of where')": "message without the file's name at ",
    "warnings.warn('seeded')": "UserWarning at ",
    # The readers' border makes a refusal of any error.
    "read_at_border(path, lambda: [][0])": "IndexError, refused as the file's fault at ",
    "read_at_border(path, lambda: int('x'))": "ValueError, refused as the file's fault at ",
    "try: {}['x']\nexcept KeyError as error: raise InputError(path) from error": (
        "KeyError, refused as the file's fault at "
    ),
}
SEEDED = """
import json, os, signal, sys, warnings
from tests.fuzzing import cases, isolation
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files.reading_border import read_at_border

def seeded(path):
    if "views" in path.name:
        exec(sys.argv[1])

for name in ("obj", "views", "config"):
    cases.READERS[name] = cases.Reader(cases.READERS[name].write, seeded)
named = cases.cases(["obj", "views", "config"], 3, 0, 9)
found = isolation.outcomes(named, isolation.Limits(cpu_s=0.3))
print(json.dumps([[str(case), outcome.verdict, outcome.kind] for case, outcome in found]))
"""


@pytest.mark.parametrize("fault", FAULTS)
def test_a_seeded_fault_is_caught(fault):
    """In one reader of three: its three cases are findings, the six others are not."""
    result = python("-c", SEEDED, fault)
    assert result.returncode == 0, result.stderr
    outcomes = json.loads(result.stdout)
    assert [name.partition(":")[0] for name, _, _ in outcomes] == ["obj", "views", "config"] * 3
    for name, verdict, kind in outcomes:
        if name.startswith("views"):
            assert verdict == "finding"
            assert kind.startswith(FAULTS[fault])
        else:
            assert verdict == "read"


@pytest.mark.parametrize("reader", READERS)
def test_valid_documents_are_read(reader, tmp_path):
    """What is changed is valid before, whichever features it has: else the reader would look no further."""
    for number in range(20):
        folder = tmp_path / str(number)
        folder.mkdir()
        path = READERS[reader].write(folder, random.Random(f"{reader} {number}"), False)
        outcome = judged(READERS[reader].read, path, False)
        assert outcome.verdict == "read", outcome


def test_a_case_is_made_again_from_its_name(tmp_path):
    """In another process, whose order of sets and hashes is another."""
    for case in cases([*READERS], 4, 0, 32):
        folder = tmp_path / str(case).replace(":", "-")
        folder.mkdir()
        case.write(folder)
    again = tmp_path / "again"
    for case in cases([*READERS], 4, 0, 8):
        result = fuzzed("--case", str(case), "--keep", str(again / str(case).replace(":", "-")))
        assert result.returncode in (0, 1), result.stderr
        made, first = again / str(case).replace(":", "-"), tmp_path / str(case).replace(":", "-")
        assert sorted(file.name for file in made.iterdir()) == sorted(file.name for file in first.iterdir())
        assert all(file.read_bytes() == (first / file.name).read_bytes() for file in made.iterdir())


def test_ctrl_c_prints_what_was_found():
    command = [sys.executable, "-m", "tests.fuzzing.run", "--cases", "1000000"]
    process = subprocess.Popen(
        command, cwd=REPOSITORY, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while not any(Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()):
        assert process.poll() is None
        time.sleep(0.05)
    while process.poll() is None:  # again, because Python loses one that falls into a destructor
        os.kill(process.pid, signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(10.0)
    shown, errors = process.communicate()
    assert process.returncode == 130, errors
    assert "go on with --first" in shown
    assert "Traceback" not in errors


def test_a_case_has_a_name():
    assert Case.parse("gltf:1:47") == Case("gltf", 1, 47)
    with pytest.raises(ValueError, match="the reader must be one of gltf, obj"):
        Case.parse("fbx:1:47")


def test_trees_are_written_with_their_marks():
    from tests.fuzzing.extremes import Nested, Raw, SecondKey

    tree = {"a": Raw("1e999"), SecondKey("a"): Nested(2, False), "b": Nested(2, True), "c": [None, "\ud800"]}
    assert json_text(tree) == '{"a":1e999,"a":[[1]],"b":{"a":{"a":1}},"c":[null,"\\ud800"]}'
    tables = {"light": [{"type": "spot"}, {"x": {"y z": float("nan")}}], "camera": {"eye": [1, 2.5]}, "n": 1}
    assert toml_text(tables) == (
        'n = 1\n[[light]]\ntype = "spot"\n\n[[light]]\nx = {"y z" = nan}\n\n[camera]\neye = [1, 2.5]\n'
    )
