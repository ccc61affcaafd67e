"""Runs a notebook without Jupyter: its code cells, one after another, in one fresh module."""

import ast
import json
from pathlib import Path
from types import ModuleType
from typing import Any


def run_notebook(path: Path) -> list[Any]:
    """Run the code cells of a notebook as a kernel would.

    Returns:
        The value of the last expression of each cell, which a notebook shows; None where there is none.
    """
    module = ModuleType("__main__")
    shown = []
    for index, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"]):
        if cell["cell_type"] != "code":
            continue
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        name = f"{path.name}[{index}]"
        exec(compile(tree, name, "exec"), module.__dict__)
        value = None
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), name, "eval"), module.__dict__)
        shown.append(value)
    return shown
