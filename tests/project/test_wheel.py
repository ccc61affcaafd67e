"""The wheel holds what an installed program reads: shaders, presets, scenes of its own."""

import subprocess
import sys
import zipfile
from pathlib import Path, PurePosixPath

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=REPOSITORY,
        check=True,
        timeout=120,
        capture_output=True,
    )
    (built,) = folder.glob("*.whl")
    return built


@pytest.mark.slow
def test_every_source_and_data_file_is_in_the_wheel(wheel):
    needed = {
        path.relative_to(REPOSITORY).as_posix()
        for package in ("renderer", "tuner", "shaders", "configs")
        for path in (REPOSITORY / package).rglob("*")
        if path.suffix in (".py", ".vert", ".frag", ".comp", ".glsl", ".json", ".glb", ".j2", ".css", ".js")
    }
    assert {".comp", ".j2"} <= {PurePosixPath(name).suffix for name in needed}
    with zipfile.ZipFile(wheel) as archive:
        assert needed <= set(archive.namelist())


@pytest.mark.slow
def test_the_wheel_runs_without_the_checkout(wheel, tmp_path):
    """Unpacked alone on the path, it draws and reports: shaders, presets, templates lie beside the code."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "installed")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path / 'installed')!r});"
        "import renderer; assert 'installed' in vpltune.renderer.__file__, vpltune.renderer.__file__;"
        "from vpltune.__main__ import run;"
        f"sys.exit(run(['render', {str(tmp_path / 'installed/configs/scenes/cornell-box.glb')!r},"
        f" '-o', {str(tmp_path / 'out.png')!r}, '--size', '64x48']) or run(['report', {str(tmp_path)!r}]))"
    )
    (tmp_path / "metrics.json").write_text('{"scene": "box.glb", "status": "ok"}', encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out.png").stat().st_size > 0
    assert "<h1>box</h1>" in (tmp_path / "report.html").read_text(encoding="utf-8")
