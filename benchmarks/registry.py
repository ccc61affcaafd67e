"""Finds benchmarks and runs them."""

import ast
import importlib
from collections.abc import Callable
from pathlib import Path

from benchmarks.row import Row


def benchmark_names() -> tuple[str, ...]:
    """Modules of this folder that define `rows`, in alphabetical order; none of them is imported."""
    return tuple(
        path.stem
        for path in sorted(Path(__file__).parent.glob("*.py"))
        if any(
            isinstance(node, ast.FunctionDef) and node.name == "rows"
            for node in ast.parse(path.read_text(encoding="utf-8")).body
        )
    )


def run_benchmark(name: str, progress: Callable[[str, float], None]) -> list[Row]:
    """Run the benchmark called `name`, one of `benchmark_names()`."""
    return importlib.import_module(f"benchmarks.{name}").rows(progress)
