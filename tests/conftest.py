"""Every shape annotation of ours is checked while tests run; scenes and corpora are found here."""

import os
from pathlib import Path

import jaxtyping
import numpy as np
import pytest

# Before any test module imports them: the hook works at import.
jaxtyping.install_import_hook(["vpltune"], "beartype.beartype")

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(autouse=True)
def floating_point_errors_raise():
    """A division by zero, an overflow or an invalid operation in a test is an error.

    Underflow is not: radiance far from a light rightly fades to zero.
    """
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


@pytest.fixture(scope="session")
def scenes_folder() -> Path:
    """Scenes that others made, which are not in the repository."""
    return _outside_folder("VPLTUNE_SCENES", "scenes")


@pytest.fixture(scope="session")
def corpora_folder() -> Path:
    """Hostile, odd and valid scene files, which are not in the repository."""
    return _outside_folder("VPLTUNE_CORPORA", "corpora")


def _outside_folder(variable: str, name: str) -> Path:
    folder = Path(os.environ.get(variable) or REPOSITORY.parent / "shared" / name)
    if not folder.is_dir():
        pytest.skip(f"no folder {folder}; set {variable} to the folder of {name}")
    return folder


@pytest.fixture(scope="session")
def playwright():
    """The one driver of browsers of this process: its event loop runs while it lives, and bars a second."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        yield driver


@pytest.fixture(scope="session")
def gl_context():
    """One OpenGL context for the whole run: making one for each test takes longer than the tests."""
    from vpltune.renderer.gpu.gpu_context import create_context

    return create_context()


@pytest.hookimpl(tryfirst=True)
def pytest_fixture_setup(fixturedef, request):
    """Fixtures of a module are made before those of a test, and what they compile belongs to the context that
    is current then: `gl_context`, where they ask for it."""
    if "gl_context" in fixturedef.argnames:
        request.getfixturevalue("gl_context").__enter__()


@pytest.fixture(autouse=True)
def gl_context_is_current(request):
    """Whatever context an earlier test made for itself, `gl_context` is the one that OpenGL calls reach."""
    if "gl_context" in request.fixturenames:
        request.getfixturevalue("gl_context").__enter__()
