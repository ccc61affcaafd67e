"""Figures in documents, each tied to the command and the row that prints it.

`docs/figures.toml` holds the ties:

    [commands.peer]
    run = ["vpltune bench peer"]     # all are run, the last one's output is read
    minutes = 5                      # about, on two cores: for the time that is left
    tolerance = 0.05                 # relative, beside half of the last digit shown

    [[figure]]                       # the first place in the document, after `after`, that `text` matches
    document = "docs/results.md"
    text = "| VPLtune's shipped file, untuned | {} / {} |"
    command = "peer"
    rows = ["kajiya-cornell-box.relmse", "kajiya-cornell-box.energy_ratio"]

    [[table]]                        # every row of the first table below a heading
    document = "docs/results.md"
    heading = "By scene"
    command = "quality"
    columns = { default = ["{scene}.{split}.default"] }

    [commands.fit_page]              # the commands after `$` in a page, and every number that they print
    page = "docs/jobs/fit.md"
    minutes = 5

    [[unmeasured]]                   # figures that no command prints here, and why
    document = "docs/results.md"
    text = "in {} of {} scenes"
    reason = "..."

A row is `name` for a benchmark's value, `name:ratio` or `name:against`; `median(...)`, `min(...)` or
`max(...)` over the rows that a pattern with `*` matches; and any of them after `100*`. Where a command prints
a Markdown table, the first `keys` cells of a line and the heading of a column, joined by dots, name a cell.
The numbers of a cell are `name`, `name#2`, `name#3`. In a `[[table]]`, `{heading}` stands for the cell in
that column.
"""

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from statistics import median

from benchmarks.harness.page_examples import examples

Values = Mapping[str, float | None]
"""What a command printed, by name; None where it printed a dash."""

NUMBER = re.compile(r"[-−]?\d+(?:,\d{3})*(?:\.\d+)?|–")
"""A number as documents have it, or the dash that stands for none."""
_ROW = re.compile(
    r"(?:(?P<scale>[\d.]+)\*)?(?:(?P<over>median|min|max)\((?P<inner>[^()]+)\)|(?P<plain>[^()]+))"
)
_OVER = {"median": median, "min": min, "max": max}


@dataclass(frozen=True)
class Command:
    """What prints figures."""

    minutes: float
    run: tuple[str, ...] = ()
    page: str = ""
    """A page whose examples are run, in place of `run`."""
    tolerance: float = 0.02
    keys: int = 0
    """Leading cells that name a line of the Markdown table that it prints; 0 for a benchmark's rows."""


@dataclass(frozen=True)
class Tied:
    """One number in a document."""

    document: str
    start: int
    """Where it stands in the document's text."""
    shown: str
    command: str
    row: str


@dataclass(frozen=True)
class Ties:
    """All of `docs/figures.toml`."""

    folder: Path
    commands: dict[str, Command]
    figures: list[dict] = field(default_factory=list)
    tables: list[dict] = field(default_factory=list)
    unmeasured: list[dict] = field(default_factory=list)

    def text(self, document: str) -> str:
        """The text of a document."""
        return (self.folder / document).read_text(encoding="utf-8")

    def tied(self) -> list[Tied]:
        """Every number that a command prints.

        Raises:
            ValueError: a tie matches nothing in its document, or names an unknown command.
        """
        found = [each for figure in self.figures for each in self._of_figure(figure)]
        found += [each for table in self.tables for each in self._of_table(table)]
        found += [
            each for name, command in self.commands.items() for each in self._of_page(name, command.page)
        ]
        unknown = {each.command for each in found} - set(self.commands)
        if unknown:
            raise ValueError(f"figures.toml: unknown commands {sorted(unknown)}")
        return found

    def untied_cells(self, document: str) -> list[str]:
        """Numbers in table cells of a document that are neither tied nor marked, with their line.

        The first cell of a line is its label.
        """
        text = self.text(document)
        known = {each.start for each in self.tied() if each.document == document}
        for mark in self.unmeasured:
            if mark["document"] == document:
                known |= {start for start, _ in self._places(mark)}
        return [
            f"{text.count(chr(10), 0, start) + 1}: {shown}"
            for line in table_lines(text)
            for cell in line[1:]
            for start, shown in cell.numbers()
            if start not in known and shown != "–"
        ]

    def _of_figure(self, figure: dict) -> Iterator[Tied]:
        places = self._places(figure)
        if len(places) != len(figure["rows"]):
            raise ValueError(f"figures.toml: {figure['text']!r} has {len(places)} numbers for its rows")
        for (start, shown), row in zip(places, figure["rows"], strict=True):
            yield Tied(figure["document"], start, shown, figure["command"], row)

    def _of_table(self, table: dict) -> Iterator[Tied]:
        for line in _table_below(self.text(table["document"]), table["document"], table["heading"]):
            cells = {cell.heading: cell for cell in line}
            names = {heading: cell.text.replace(" ", "_") for heading, cell in cells.items()}
            for heading, rows in table["columns"].items():
                for (start, shown), row in zip(cells[heading].numbers(), rows, strict=True):
                    yield Tied(table["document"], start, shown, table["command"], row.format(**names))

    def _of_page(self, name: str, page: str) -> Iterator[Tied]:
        for index, example in enumerate(examples(self.text(page)) if page else ()):
            for place, (start, shown) in enumerate(example.numbers()):
                yield Tied(page, start, shown, name, f"{index}.{place}")

    def _places(self, tie: dict) -> list[tuple[int, str]]:
        """The numbers of a text, or of the whole table below a heading."""
        text, document = self.text(tie["document"]), tie["document"]
        if "heading" in tie:
            lines = _table_below(text, document, tie["heading"])
            return [place for line in lines for cell in line for place in cell.numbers()]
        begin = text.find(tie.get("after", ""))
        # Text is wrapped anywhere.
        words = re.escape(tie["text"]).replace(r"\{\}", f"({NUMBER.pattern})").replace(r"\ ", r"\s+")
        match = re.compile(words).search(text, begin) if begin >= 0 else None
        if match is None:
            raise ValueError(f"figures.toml: {document} has no {tie['text']!r}")
        return [(match.start(group), match[group]) for group in range(1, 1 + (match.re.groups or 0))]


@dataclass(frozen=True)
class Cell:
    """A cell of a Markdown table."""

    heading: str
    text: str
    start: int
    """Where its text stands in the document."""

    def numbers(self) -> list[tuple[int, str]]:
        """Its numbers, and where each stands."""
        return [(self.start + match.start(), match[0]) for match in NUMBER.finditer(self.text)]


def read_ties(path: Path) -> Ties:
    """Read `docs/figures.toml`; documents are named from the folder above its own.

    Raises:
        ValueError: a command lacks a member or has one too many.
    """
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    try:
        commands = {
            name: Command(**{**members, "run": tuple(members.get("run", ()))})
            for name, members in content["commands"].items()
        }
    except (KeyError, TypeError) as error:
        raise ValueError(f"{path.name}: {error}") from error
    return Ties(
        path.parents[1],
        commands,
        content.get("figure", []),
        content.get("table", []),
        content.get("unmeasured", []),
    )


def table_lines(text: str) -> Iterator[list[Cell]]:
    """The lines of every Markdown table in a text, without its headings."""
    headings: list[str] = []
    position, ruled = 0, False
    for line in text.splitlines(keepends=True):
        if not line.startswith("|"):
            headings, ruled = [], False
        elif not headings:
            headings = [cell.strip() for cell in line.strip().strip("|").split("|")]
        elif not ruled:
            ruled = True
        else:
            yield _cells(line, position, headings)
        position += len(line)


def markdown_values(text: str, keys: int) -> Values:
    """The numbers of the Markdown tables that a command printed."""
    values: dict[str, float | None] = {}
    for line in table_lines(text):
        name = ".".join(cell.text.replace(" ", "_") for cell in line[:keys])
        for cell in line[keys:]:
            for index, (_, shown) in enumerate(cell.numbers()):
                suffix = f"#{index + 1}" if index else ""
                values[f"{name}.{cell.heading.replace(' ', '_')}{suffix}"] = number(shown)
    return values


def row_values(rows: list[dict]) -> Values:
    """The figures of a benchmark's rows, as `vpltune bench --json` prints them."""
    values: dict[str, float | None] = {}
    for row in rows:
        values[row["name"]] = row["value"]
        values[f"{row['name']}:ratio"] = row["ratio"]
        values[f"{row['name']}:against"] = row["against_value"]
    return values


def number(shown: str) -> float | None:
    """A number as a document shows it; None for a dash."""
    return None if shown == "–" else float(shown.replace(",", "").replace("−", "-"))


def evaluated(row: str, values: Values) -> float | None:
    """What a tie's row is among a command's values; None for a dash.

    Raises:
        KeyError: the command printed no such row.
    """
    match = _ROW.fullmatch(row)
    if match is None:
        raise KeyError(f"{row!r} is no row")
    if match["over"]:
        pattern, colon, part = match["inner"].partition(":")
        chosen = [
            value
            for name, value in values.items()
            if value is not None
            and name.partition(":")[2] == part
            and bool(colon) == (":" in name)
            and fnmatchcase(name.partition(":")[0], pattern)
        ]
        if not chosen:
            raise KeyError(f"no row matches {row!r}")
        value = _OVER[match["over"]](chosen)
    else:
        value = values[match["plain"]]
    return None if value is None else value * float(match["scale"] or 1.0)


def decimals(shown: str) -> int:
    """Digits after the point; 7 for 2.22e-05."""
    mantissa, _, exponent = shown.partition("e")
    return max(0, len(mantissa.partition(".")[2]) - int(exponent or 0))


def has_changed(shown: str, value: float | None, tolerance: float) -> bool:
    """Whether a value is further from what is shown than `tolerance` and half of the last digit."""
    was = number(shown)
    if was is None or value is None:
        return was is not value
    return abs(value - was) > tolerance * abs(was) + 0.5 * 10.0 ** -decimals(shown) * (1.0 + 1e-9)


def _cells(line: str, position: int, headings: list[str]) -> list[Cell]:
    cells, place = [], position + 1
    for heading, part in zip(headings, line.rstrip("\n").strip("|").split("|"), strict=False):
        cells.append(Cell(heading, part.strip(), place + len(part) - len(part.lstrip())))
        place += len(part) + 1
    return cells


def _table_below(text: str, document: str, heading: str) -> list[list[Cell]]:
    match = re.search(rf"^#+ {re.escape(heading)}$", text, re.MULTILINE)
    if match is None:
        raise ValueError(f"figures.toml: {document} has no heading {heading!r}")
    end = re.search(r"^#", text[match.end() :], re.MULTILINE)
    part = text[: match.end() + end.start()] if end else text
    lines = [line for line in table_lines(part) if line[0].start > match.end()]
    if not lines:
        raise ValueError(f"figures.toml: {document} has no table below {heading!r}")
    return lines
