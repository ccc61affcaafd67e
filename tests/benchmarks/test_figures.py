"""Figures in documents are tied to rows of commands, and a change of one is seen."""

from pathlib import Path

import pytest

from benchmarks.harness.figures import (
    Command,
    evaluated,
    has_changed,
    markdown_values,
    number,
    read_ties,
    row_values,
)
from benchmarks.harness.page_examples import example_values, examples
from benchmarks.harness.registry import benchmark_names
from benchmarks.harness.row import Row

REPOSITORY = Path(__file__).resolve().parents[2]
TIES = read_ties(REPOSITORY / "docs" / "figures.toml")
RESULT_PAGES = ("README.md", "docs/results.md")

TABLE = """
| scene | VPLs | relmse | all three |
|---|---|---|---|
| a room | 1,024 | 0.50 | 0.1 / 2 / – |
"""


def test_every_tie_stands_in_its_document():
    """Else `tied` raises and names the text that is gone. Each number stands where the tie says."""
    tied = TIES.tied()
    assert {each.document for each in tied} >= set(RESULT_PAGES)
    for each in tied:
        assert TIES.text(each.document)[each.start :].startswith(each.shown)


@pytest.mark.parametrize("page", RESULT_PAGES)
def test_every_number_in_a_result_table_is_tied_or_marked(page):
    """Else: tie it to its command in docs/figures.toml, or say there why no command prints it here."""
    assert TIES.untied_cells(page) == []


def test_every_command_is_used_and_every_benchmark_exists():
    assert {each.command for each in TIES.tied()} == set(TIES.commands)
    named = {
        line.split()[2] for c in TIES.commands.values() for line in c.run if line.startswith("vpltune bench")
    }
    assert named <= set(benchmark_names())
    assert all(mark["reason"] for mark in TIES.unmeasured)


@pytest.mark.parametrize(
    ("shown", "value", "changed"),
    [
        ("0.46", 0.4649, False),  # half of the last digit
        ("0.46", 0.476, True),
        ("100", 101.9, False),  # two per cent, and half
        ("100", 103.0, True),
        ("1,024", 1024.0, False),
        ("–", None, False),
        ("–", 0.0, True),
        ("0.1", None, True),
    ],
)
def test_a_change_is_beyond_the_tolerance_and_the_last_digit(shown, value, changed):
    assert has_changed(shown, value, 0.02) is changed


def test_rows_are_named_by_part_and_joined_over_a_pattern():
    values = row_values([Row(f"error.{n}", v, "1", "x", 2.0).as_dict() for n, v in (("a", 1.0), ("b", 4.0))])
    assert evaluated("error.a", values) == 1.0
    assert evaluated("100*error.b:ratio", values) == 200.0
    assert evaluated("median(error.*)", values) == 2.5
    assert evaluated("max(error.*:ratio)", values) == 2.0
    for missing in ("error.c", "min(other.*)", ""):
        with pytest.raises(KeyError):
            evaluated(missing, values)


def test_a_printed_table_is_named_by_its_first_cells():
    assert markdown_values(TABLE, keys=2) == {
        "a_room.1,024.relmse": 0.5,
        "a_room.1,024.all_three": 0.1,
        "a_room.1,024.all_three#2": 2.0,
        "a_room.1,024.all_three#3": None,
    }
    assert number("−1.5") == -1.5


PAGE = """# Page

```
$ vpltune one --size 64x48 -o out/a-3
error 0.25, 2.2e-05 of 7 (56.9 s)
wrote out/a-3
$ vpltune two
│ -1.5 │ 2 % │
```

```json
{"not": 9}
```
"""


def test_numbers_of_examples_are_those_that_the_command_measured():
    """No parts of names and sizes, and no seconds."""
    found = list(examples(PAGE))
    assert [example.command for example in found] == ["vpltune one --size 64x48 -o out/a-3", "vpltune two"]
    assert [[shown for _, shown in e.numbers()] for e in found] == [["0.25", "2.2e-05", "7"], ["-1.5", "2"]]
    assert all(PAGE[start:].startswith(shown) for e in found for start, shown in e.numbers())
    assert example_values(1, found[1].output) == {"1.0": -1.5, "1.1": 2.0}
    assert not has_changed("2.2e-05", 2.24e-5, 0.0)
    assert has_changed("2.2e-05", 2.4e-5, 0.0)


def made_ties(folder: Path, more: str = ""):
    """A document with a table and a sentence, and a command that prints the table with 0.50 as 0.60."""
    (folder / "docs").mkdir()
    (folder / "page.md").write_text(f"# Page\n\nIt is 0.50 of 7.\n\n## Errors\n{TABLE}", encoding="utf-8")
    printed = TABLE.replace("0.50", "0.60")
    (folder / "print.py").write_text(f"print({printed!r}); open('runs', 'a').write('x')", encoding="utf-8")
    (folder / "docs" / "figures.toml").write_text(
        f"""
        [commands.made]
        run = ["python print.py"]
        keys = 2
        minutes = 1
        [[figure]]
        document = "page.md"
        text = "It is {{}} of {{}}"
        command = "made"
        rows = ["a_room.1,024.relmse", "a_room.1,024.gone"]
        [[table]]
        document = "page.md"
        heading = "Errors"
        command = "made"
        columns = {{ relmse = ["{{scene}}.{{VPLs}}.relmse"] }}
        {more}
        """,
        encoding="utf-8",
    )
    return read_ties(folder / "docs" / "figures.toml")


def test_cells_that_are_not_tied_are_named_by_their_line(tmp_path):
    ties = made_ties(tmp_path)
    assert ties.untied_cells("page.md") == ["9: 1,024", "9: 0.1", "9: 2"]
    more = '[[unmeasured]]\ndocument = "page.md"\nheading = "Errors"\nreason = "a GPU\'s"'
    (tmp_path / "second").mkdir()
    assert made_ties(tmp_path / "second", more).untied_cells("page.md") == []


def test_a_text_that_is_gone_is_named(tmp_path):
    ties = made_ties(tmp_path)
    (tmp_path / "page.md").write_text("# Page\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"page.md has no 'It is \{\} of \{\}'"):
        ties.tied()


def test_figures_are_run_compared_and_kept(tmp_path, monkeypatch, capfd):
    """Two figures of 0.50 are 0.60 now, and one has no row; a second run runs nothing."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    import figures

    ties = made_ties(tmp_path)
    monkeypatch.setattr(figures, "REPOSITORY", tmp_path)
    for _ in range(2):
        values = figures.outputs(ties.commands, ties, tmp_path)
        lines, changed = figures.compared(ties.tied(), ties, values)
        assert changed == 3
        assert lines[2:] == [
            "| page.md:3 | a_room.1,024.relmse | 0.50 | 0.60 | yes |",
            "| page.md:3 | a_room.1,024.gone | 7 | no row | yes |",
            "| page.md:9 | a_room.1,024.relmse | 0.50 | 0.60 | yes |",
        ]
    assert (tmp_path / "runs").read_text(encoding="utf-8") == "x"
    assert capfd.readouterr().err == "0%, about 1 min left: made\n"


def test_a_command_that_fails_keeps_nothing(tmp_path, monkeypatch, capfd):
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    import figures

    monkeypatch.setattr(figures, "REPOSITORY", tmp_path)
    failing = Command(1.0, ("python -c 'raise SystemExit(3)'",))
    assert figures.outputs({"failing": failing}, TIES, tmp_path) == {}
    assert "exit code 3" in capfd.readouterr().err
    assert not list(tmp_path.glob("*.json"))
