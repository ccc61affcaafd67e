"""Finds benchmarks and runs them."""

import ast
import importlib
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.harness.row import Row

FOLDERS = ("speed", "quality", "tuning")
"""Folders of `benchmarks` that are searched."""


def benchmark_names() -> tuple[str, ...]:
    """The names of all benchmarks in alphabetical order."""
    return tuple(sorted(_modules()))


def run_benchmark(name: str, progress: Callable[[str, float], None]) -> Iterator[Row]:
    """Run the benchmark `name`, one of `benchmark_names()`; it calls `progress` with a stage and a share.

    Some yield each row as soon as it is measured, others all at the end.
    """
    yield from importlib.import_module(_modules()[name]).rows(progress)


def _modules() -> dict[str, str]:
    """Module names by benchmark name: the files of `FOLDERS` that define `rows`. Nothing is imported."""
    return {
        path.stem: f"benchmarks.{folder}.{path.stem}"
        for folder in FOLDERS
        for path in sorted((Path(__file__).parents[1] / folder).glob("*.py"))
        if any(
            isinstance(node, ast.FunctionDef) and node.name == "rows"
            for node in ast.parse(path.read_text(encoding="utf-8")).body
        )
    }
