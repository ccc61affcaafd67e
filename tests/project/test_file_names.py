"""Names and sizes that keep the code findable."""

import ast
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGES = ("renderer", "tuner", "window", "benchmarks", "configs", "shaders", "tests")
SAY_NOTHING = {"utils", "util", "common", "helpers", "helper", "misc", "core", "base"}

PYTHON_FILES = sorted(path for package in PACKAGES for path in (REPOSITORY / package).rglob("*.py"))


def test_no_python_file_has_a_name_that_says_nothing():
    assert PYTHON_FILES
    assert not [str(path) for path in PYTHON_FILES if path.stem.lower() in SAY_NOTHING]


@pytest.mark.parametrize("package", ["renderer", "tuner", "window"])
def test_package_files_only_export(package):
    """An `__init__.py` holds its docstring, imports, `__all__` and the lazy `__getattr__`, no more."""
    for path in (REPOSITORY / package).rglob("__init__.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            lazy = isinstance(node, ast.FunctionDef) and node.name in ("__getattr__", "__dir__")
            plain = isinstance(node, ast.Import | ast.ImportFrom | ast.Assign | ast.AnnAssign | ast.If)
            assert docstring or lazy or plain, f"{path}:{node.lineno} is more than an export"


def test_python_files_stay_short():
    """400 lines: past that a file is more than one technique."""
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in PYTHON_FILES}
    assert not {str(path): length for path, length in lengths.items() if length > 400}
