"""The rules of `scripts/check_words.py`: that it finds what breaks them, and that nothing here does."""

import importlib.util
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def check_words():
    """The script as a module; scripts are no package."""
    spec = importlib.util.spec_from_file_location("check_words", REPOSITORY / "scripts" / "check_words.py")
    module = importlib.util.module_from_spec(spec)
    # Its dataclass looks its own module up.
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def found(findings):
    return [(finding.line, finding.rule) for finding in findings]


OF = '''"""Of a module."""
LIMIT = 3
"""Of a constant."""

def _private():
    """Of a private function."""
    def nested():
        """Offset: no finding."""
'''

DOCSTRINGS = '''from typing import Protocol, overload

class Watcher(Protocol):
    """Documented."""
    def found(self): ...
    def happened(self):
        """Documented."""
        def nested(): pass
    def _private(self): ...
    def __init__(self): ...
    @overload
    def other(self, a: int): ...
    @found.setter
    def found(self, value): ...
class _Private:
    def method(self): ...
if True:
    async def task(): ...
'''

CONSTANTS = '''"""Documented."""
UNEXPLAINED = 3
TUPLE = 1, -2.0

# Explains both.
FIRST: float = 1e-3
SECOND = 2 * 2**10

AT_THE_END = 3  # pixels
SILENCED = 3  # noqa: E501
BELOW = (1, 2)
"""Says what it is."""
SECOND_AFTER_BELOW = 5
PI = 3.14159
TEXT, FLAG, DERIVED, lower = "", True, FIRST * 2, 3
_A, _B = 1, 2
'''

GLSL = """// What the file is.

const float UNEXPLAINED = 1.0;
const vec2 VECTOR = vec2(0.5, 1e-3);
// Explains both.
const uint MASK = 0xffu;
const int[2] NO_MATCH = int[2](1, 2);
const int SECOND = 3;
const float PI = 3.14159265358979;

const int AT_THE_END = 3; // pixels
const int DERIVED = SIZE * 2;
/* A comment of
   two lines. */
const uint BITS = 4u;
void main() {
    const int local = 3;
}
const ivec3 LAST = ivec3(1);
"""


def test_a_docstring_that_begins_with_of_is_found(check_words):
    assert found(check_words.python_findings(OF)) == [(1, "of"), (3, "of"), (6, "of")]


def test_what_is_public_and_has_no_docstring_is_found(check_words):
    findings = check_words.python_findings(DOCSTRINGS)
    assert [(finding.line, finding.name) for finding in findings] == [
        (1, "module"),
        (5, "Watcher.found"),
        (18, "task"),
    ]


def test_an_unexplained_constant_of_python_is_found(check_words):
    assert [(finding.line, finding.name) for finding in check_words.python_findings(CONSTANTS)] == [
        (2, "UNEXPLAINED"),
        (3, "TUPLE"),
        (10, "SILENCED"),
        (13, "SECOND_AFTER_BELOW"),
        (16, "_A"),
        (16, "_B"),
    ]


def test_an_unexplained_constant_of_glsl_is_found(check_words):
    assert [(finding.line, finding.name) for finding in check_words.glsl_findings(GLSL)] == [
        (3, "UNEXPLAINED"),
        (4, "VECTOR"),
        (8, "SECOND"),
        (19, "LAST"),
    ]


def test_files_are_read_once_and_links_not_followed(check_words, tmp_path):
    (tmp_path / "tuner").mkdir()
    (tmp_path / "vpltune").mkdir()
    (tmp_path / "tuner" / "a.py").write_text('"""A."""\nLIMIT = 3\n')
    (tmp_path / "tuner" / "a.comp").write_text("const int LIMIT = 3;\n")
    (tmp_path / "vpltune" / "tuner").symlink_to("../tuner")
    findings = [(path.as_posix(), each.line) for path, each in check_words.tree_findings(tmp_path)]
    assert findings == [("tuner/a.comp", 1), ("tuner/a.py", 2)]


def test_nothing_here_breaks_the_rules(check_words):
    assert not [f"{path}:{each.line} {each.rule}" for path, each in check_words.tree_findings(REPOSITORY)]
