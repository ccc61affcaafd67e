"""The notebooks of `examples/` run, hold no outputs, and name no machine's paths."""

import json
import re
from pathlib import Path

import pytest
from notebook_cells import run_notebook
from PIL import Image

REPOSITORY = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((REPOSITORY / "examples").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs_or_paths(path):
    document = json.loads(path.read_text(encoding="utf-8"))
    assert (document["nbformat"], document["nbformat_minor"]) == (4, 5)
    for cell in document["cells"]:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None
        assert not re.search(r"(?<![\w.])(/home|/tmp|/work|/Users|[A-Z]:\\)", "".join(cell["source"]))


@pytest.mark.slow
def test_the_fit_from_arrays_runs_and_shows_what_it_says(capsys):
    """The cells hold the checks of gradient and loss; what they show is an image, a scene and a result."""
    shown = run_notebook(REPOSITORY / "examples" / "fit_from_arrays.ipynb")
    scene, result = (
        next(each for each in shown if type(each).__name__ == name) for name in ("Scene", "FitResult")
    )
    assert repr(scene) == "Scene('room', 12 triangles, 1 instance, 1 material)"
    images = [each for each in shown if isinstance(each, Image.Image)]
    assert [image.size for image in images] == [(320, 240), (640, 240)]
    assert [view.name for view in result.views[:2]] == ["front", "side"]
    assert "data:image/png;base64," in result._repr_html_()
    printed = capsys.readouterr().out
    assert printed.count("falloff_footprint") >= 2
