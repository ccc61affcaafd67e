"""Check that the code explains itself: docstrings and the comments of constants.

Rules, for Python in the folders below, and for the constants of GLSL:

    of          a docstring begins with "Of "
    docstring   a public module, class, function or method has no docstring
    constant    a constant is a number, and no comment and no docstring says what it is

Each finding is one line, `file:line rule: name`. The exit code is 1 where there are any.
"""

import ast
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
FOLDERS = ("renderer", "tuner", "window", "vpltune", "shaders", "benchmarks", "scripts")
GLSL_SUFFIXES = (".glsl", ".comp", ".vert", ".frag")
# Names that every reader knows.
KNOWN_CONSTANTS = ("PI",)

GLSL_CONSTANT = re.compile(r"const\s+(?:u?int|float|[iu]?vec[234])\s+(\w+)\s*(?:\[\w*\]\s*)?=(.*)")
# A name in a value makes it no number; these are parts of numbers and of vectors of them.
GLSL_NUMBER_WORDS = re.compile(
    r"\b(?:0x[0-9a-f]+u?|[0-9]+u|[0-9.]+(?:e[+-]?[0-9]+)?f?|[iu]?vec[234])", re.IGNORECASE
)


@dataclass(frozen=True, order=True)
class Finding:
    """One place that breaks a rule."""

    line: int
    rule: str
    name: str


def python_findings(source: str) -> list[Finding]:
    """The findings in the text of a Python module."""
    tree = ast.parse(source)
    return sorted(
        [*_docstrings_with_of(tree), *_missing_docstrings(tree), *_unexplained_constants(tree, source)]
    )


def glsl_findings(source: str) -> list[Finding]:
    """The findings in the text of a shader: constants at the top level, as functions name their own numbers.

    One comment explains all constants on the lines below it, up to the next other line.
    """
    findings = []
    depth = 0
    explained = False
    for number, line in enumerate(source.splitlines(), 1):
        code, comment = re.match(r"(.*?)(//.*|/\*.*)?$", line).groups()  # type: ignore[union-attr]
        constant = GLSL_CONSTANT.match(code) if depth == 0 else None
        if constant is None:
            # The end of a comment that began on an earlier line.
            ends_comment = code.rstrip().endswith("*/")
            explained = (comment is not None and not code.strip()) or ends_comment
        elif not explained and comment is None and _is_glsl_number(*constant.groups()):
            findings.append(Finding(number, "constant", constant[1]))
        depth += code.count("{") - code.count("}")
    return findings


def _is_glsl_number(name: str, value: str) -> bool:
    return name not in KNOWN_CONSTANTS and not re.search(r"[A-Za-z_]", GLSL_NUMBER_WORDS.sub("", value))


def tree_findings(repository: Path) -> Iterator[tuple[Path, Finding]]:
    """The findings in all files of a checkout, by file and line."""
    for folder in FOLDERS:
        for path in sorted((repository / folder).rglob("*")):
            # vpltune holds links to the other folders, which are read where they lie.
            if path.is_symlink() or not path.is_file():
                continue
            if path.suffix == ".py":
                findings = python_findings(path.read_text(encoding="utf-8"))
            elif path.suffix in GLSL_SUFFIXES:
                findings = glsl_findings(path.read_text(encoding="utf-8"))
            else:
                continue
            for finding in findings:
                yield path.relative_to(repository), finding


def _docstrings_with_of(tree: ast.Module) -> Iterator[Finding]:
    """Docstrings of modules, classes and functions, and those below an assignment."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else ():
            text = _literal_text(statement)
            if text is not None and text.lstrip().startswith("Of "):
                yield Finding(statement.lineno, "of", text.strip().partition("\n")[0])


def _missing_docstrings(tree: ast.Module) -> Iterator[Finding]:
    if ast.get_docstring(tree) is None:
        yield Finding(1, "docstring", "module")
    yield from _undocumented(tree.body, "")


def _undocumented(body: list[ast.stmt], prefix: str) -> Iterator[Finding]:
    """Classes, functions and methods; what is inside a function or a private class is not public."""
    for node in body:
        if isinstance(node, ast.If | ast.Try | ast.With):
            yield from _undocumented(node.body, prefix)
            yield from _undocumented(getattr(node, "orelse", []), prefix)
        if not isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        if node.name.startswith("_") or _is_variant(node):
            continue
        if ast.get_docstring(node) is None:
            yield Finding(node.lineno, "docstring", prefix + node.name)
        if isinstance(node, ast.ClassDef):
            yield from _undocumented(node.body, f"{prefix}{node.name}.")


def _is_variant(node: ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether another function of the same name has the docstring: overloads, setters."""
    names = {ast.unparse(decorator).rpartition(".")[2] for decorator in node.decorator_list}
    return bool(names & {"overload", "setter", "deleter"})


def _unexplained_constants(tree: ast.Module, source: str) -> Iterator[Finding]:
    """One comment explains all constants on the lines below it, up to the next other line."""
    whole_lines, line_ends = _comment_lines(source)
    explained_line = 0
    for node, following in zip(tree.body, [*tree.body[1:], None], strict=True):
        names = _number_names(node)
        if not names:
            continue
        last = node.end_lineno or node.lineno
        above = node.lineno - 1 in whole_lines or node.lineno - 1 == explained_line
        inside = any(line in line_ends for line in range(node.lineno, last + 1))
        below = following is not None and _literal_text(following) is not None
        if above:
            explained_line = last
        if not (above or inside or below):
            for name in names:
                if name not in KNOWN_CONSTANTS:
                    yield Finding(node.lineno, "constant", name)


def _number_names(node: ast.stmt) -> list[str]:
    """The upper-case names that a statement makes numbers, or tuples of numbers."""
    if isinstance(node, ast.Assign):
        targets = [each for target in node.targets for each in getattr(target, "elts", None) or (target,)]
        value = node.value
    elif isinstance(node, ast.AnnAssign) and node.value is not None:
        targets, value = [node.target], node.value
    else:
        return []
    names = [target.id for target in targets if isinstance(target, ast.Name)]
    return [name for name in names if re.fullmatch(r"_?[A-Z][A-Z0-9_]*", name) and _is_number(value)]


def _is_number(value: ast.expr) -> bool:
    if isinstance(value, ast.Constant):
        return isinstance(value.value, int | float | complex) and not isinstance(value.value, bool)
    if isinstance(value, ast.UnaryOp):
        return _is_number(value.operand)
    if isinstance(value, ast.BinOp):
        return _is_number(value.left) and _is_number(value.right)
    return isinstance(value, ast.Tuple) and bool(value.elts) and all(map(_is_number, value.elts))


def _comment_lines(source: str) -> tuple[set[int], set[int]]:
    """The lines that are a comment, and the lines of code that end with one; a note to a linter is none."""
    whole, ends = set(), set()
    for token in tokenize.generate_tokens(StringIO(source).readline):
        if token.type == tokenize.COMMENT and not re.match(r"#\s*(noqa|type:|fmt:|pyright:)", token.string):
            (ends if token.line[: token.start[1]].strip() else whole).add(token.start[0])
    return whole, ends


def _literal_text(statement: ast.stmt) -> str | None:
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return statement.value.value if isinstance(statement.value.value, str) else None
    return None


def main() -> int:
    """Print the findings; their number by folder goes to stderr."""
    counts: Counter[str] = Counter()
    for path, finding in tree_findings(REPOSITORY):
        print(f"{path.as_posix()}:{finding.line} {finding.rule}: {finding.name}")
        counts[path.parts[0]] += 1
    for folder, count in sorted(counts.items()):
        print(f"check_words: {count} in {folder}", file=sys.stderr)
    return 1 if counts else 0


if __name__ == "__main__":
    sys.exit(main())
