"""The wheel: what it holds, and that it works alone, beside decoys and without its extras."""

import json
import os
import re
import site
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from vpltune.tuner.doctor.extras import EXTRA_MODULES

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDERS = ("renderer", "tuner", "window", "shaders", "configs")
# Run by Python itself at its start: the modules are not found, as if they were not installed.
BLOCKER = f"""
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {EXTRA_MODULES["tuner"]!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocker())
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=REPOSITORY,
        check=True,
        capture_output=True,
    )
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """The program in an environment of its own, which sees the packages here but not this checkout."""
    return Installation(wheel, tmp_path_factory.mktemp("installed"))


@pytest.fixture(scope="module")
def runtime_alone(wheel, tmp_path_factory):
    """The same without the extra `tuner`."""
    return Installation(wheel, tmp_path_factory.mktemp("runtime"), BLOCKER)


class Installation:
    """A wheel in a virtual environment."""

    def __init__(self, wheel: Path, folder: Path, sitecustomize: str = "") -> None:
        self.folder = folder
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder / "venv")], check=True)
        python = str(folder / "venv" / "bin" / "python")
        (packages,) = (folder / "venv" / "lib").glob("python*/site-packages")
        # A folder that is named in a .pth file has its own .pth files left alone: not even an editable
        # installation of this checkout is seen.
        (packages / "packages_of_the_tests.pth").write_text("\n".join(site.getsitepackages()) + "\n")
        if sitecustomize:
            (packages / "sitecustomize.py").write_text(sitecustomize)
        pip = [sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-deps", "--no-index"]
        subprocess.run([*pip, str(wheel)], check=True, capture_output=True, cwd=folder)
        self.package = packages / "vpltune"
        self.scene = self.package / "configs" / "scenes" / "cornell-box.glb"

    def run(self, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
        """One command line of the installed program."""
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        # What an incomplete installation finds out about the machine is not to be kept for others.
        environment["VPLTUNE_CACHE"] = str(self.folder / "cache")
        return subprocess.run(
            [str(self.folder / "venv" / "bin" / "vpltune"), *arguments],
            cwd=cwd,
            env=environment,
            capture_output=True,
            text=True,
        )


@pytest.fixture
def decoys(tmp_path) -> Path:
    """A working folder whose packages have the names of our folders."""
    for name in (*FOLDERS, "benchmarks"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"raise ImportError('the decoy {name} was imported')\n")
    return tmp_path


def checked(done: subprocess.CompletedProcess[str]) -> subprocess.CompletedProcess[str]:
    assert done.returncode == 0, done.stderr
    assert "decoy" not in done.stdout + done.stderr
    return done


@pytest.mark.slow
def test_the_wheel_has_one_package_at_its_top(wheel):
    with zipfile.ZipFile(wheel) as archive:
        tops = {name.partition("/")[0] for name in archive.namelist()}
    version = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert tops == {"vpltune", f"vpltune-{version}.dist-info"}


@pytest.mark.slow
def test_every_source_and_data_file_is_in_the_wheel(wheel):
    needed = {
        f"vpltune/{path.relative_to(REPOSITORY).as_posix()}"
        for folder in FOLDERS
        for path in (REPOSITORY / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert needed <= set(names)
    assert len(names) == len(set(names))
    assert not [name for name in names if "__pycache__" in name]
    assert {"vpltune/py.typed", "vpltune/__main__.py", "vpltune/cli/render.py"} <= set(names)


@pytest.mark.slow
def test_the_installed_program_works_beside_decoys(installed, decoys):
    doctor = json.loads(checked(installed.run("doctor", "--json", cwd=decoys)).stdout)
    assert doctor["status"] == "ok"
    assert not re.search(r"^\W*bench ", checked(installed.run("--help", cwd=decoys)).stdout, re.MULTILINE)

    scene = str(installed.scene)
    checked(installed.run("render", scene, "-o", "image.png", "--size", "64x48", cwd=decoys))
    assert (decoys / "image.png").stat().st_size > 0

    fit = ["fit", scene, "-o", "fit", "--views", "1", "--size", "32x24", "--json"]
    assert json.loads(checked(installed.run(*fit, cwd=decoys)).stdout)["status"] in ("improved", "kept")
    checked(installed.run("report", "fit", cwd=decoys))
    assert "<h1>cornell-box</h1>" in (decoys / "fit" / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_runtime_works_without_the_tuner(runtime_alone, decoys):
    assert "Usage: vpltune" in checked(runtime_alone.run("--help", cwd=decoys)).stdout

    scene = str(runtime_alone.scene)
    checked(runtime_alone.run("render", scene, "-o", "image.png", "--size", "64x48", cwd=decoys))
    assert (decoys / "image.png").stat().st_size > 0
    checked(runtime_alone.run("export", "default", "--to", "glsl", "-o", "tuned.glsl", cwd=decoys))
    assert "VPL_INTENSITY" in (decoys / "tuned.glsl").read_text()

    doctor = checked(runtime_alone.run("doctor", "--json", cwd=decoys))
    findings = {finding["name"]: finding for finding in json.loads(doctor.stdout)["findings"]}
    assert findings["mitsuba"]["detail"] == "needs vpltune[tuner], which is not installed"
    assert findings["opengl"]["state"] in ("ok", "fallback")


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ["fit", "SCENE", "-o", "out"],
        ["evaluate", "SCENE", "--config", "default"],
        ["batch", ".", "-o", "out"],
        ["report", "."],
        ["train-prior", "-o", "out.json", "--generated", "1"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_command_of_the_tuner_says_what_it_needs(runtime_alone, tmp_path, arguments):
    scene = str(runtime_alone.scene)
    done = runtime_alone.run(*(scene if each == "SCENE" else each for each in arguments), cwd=tmp_path)
    assert done.returncode == 3
    assert done.stdout == ""
    assert done.stderr == (
        f"vpltune: vpltune {arguments[0]} needs vpltune[tuner], which is not installed: "
        'pip install "vpltune[tuner]"\n'
    )
    assert not list(tmp_path.iterdir())
