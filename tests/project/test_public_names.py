"""The package's public names: few, documented, listed, and usable without the types that tests insist on."""

import inspect
import pydoc
import subprocess
import sys
from pathlib import Path

import pytest

import vpltune

REPOSITORY = Path(__file__).resolve().parents[2]

# Arguments of the kinds that notebooks hold, and of wrong ones; each line prints what comes of it.
WITHOUT_CHECKS_OF_TYPES = """
import numpy as np, vpltune
square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
halves = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
light = vpltune.Light("spot", 10, [0, 0, 2], (0, 0, -1), outer_cone=np.float32(0.5))
camera = vpltune.Camera(vpltune.look_at([0, 0, 3], [0, 0, 0]), np.float32(1))
print(vpltune.scene_from_arrays(square, halves, albedo=1, lights=[light], cameras=[camera]))

def refused(**arguments):
    try:
        vpltune.scene_from_arrays(square, halves, **arguments)
    except vpltune.InputError as error:
        print(error)

refused(lights=["lamp"])
refused(lights=light)
refused(cameras=[light])
"""


def test_dir_is_what_the_package_offers():
    assert dir(vpltune) == sorted(vpltune.__all__)
    assert len(dir(vpltune)) <= 24  # a choice: what fits on a screen


@pytest.mark.parametrize("name", vpltune.__all__)
def test_every_name_is_there_and_says_what_it_is(name):
    value = getattr(vpltune, name)
    documented = inspect.getdoc(value)
    assert documented, name
    assert not documented.startswith(f"{name}("), "the docstring that a dataclass writes by itself"


def test_help_lists_every_name():
    text = pydoc.plain(pydoc.render_doc(vpltune))
    top = text[: text.index("PACKAGE CONTENTS")]
    assert not [name for name in vpltune.__all__ if name not in top]


def test_what_notebooks_hold_is_taken_and_what_is_wrong_is_said():
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_CHECKS_OF_TYPES],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "Scene('arrays', 2 triangles, 1 instance, 1 material, 1 light, 1 camera)",
        "lights[0]: must be a Light, got str",
        "scene_from_arrays: lights: must be a sequence, got Light",
        "cameras[0]: must be a Camera, got Light",
    ]
