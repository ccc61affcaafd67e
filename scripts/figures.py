"""Run every command whose figures stand in a document, and say which figures changed.

`make figures`, or `python scripts/figures.py [--only NAME] [--list]`. docs/figures.toml ties figures to
commands. Output is kept in out/figures, in a folder for each state of the program: an interrupted run goes on
with the same command. The exit code is 1 where a figure changed beyond its tolerance, or has no row any more.
"""

import argparse
import hashlib
import json
import os
import shlex
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.harness.figures import (
    Command,
    Tied,
    Ties,
    Values,
    decimals,
    evaluated,
    has_changed,
    markdown_values,
    read_ties,
    row_values,
)
from benchmarks.harness.page_examples import example_values, examples
from benchmarks.harness.program_digest import DIGEST_LENGTH, program_digest
from benchmarks.harness.scene_library import REPOSITORY
from vpltune.renderer.files.atomic_file import write_text_whole

COLUMNS = 120
"""Columns of the terminal that examples print for: the pages'."""


def main() -> int:
    """Run the commands, print the table, and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", metavar="NAME", help="one command of docs/figures.toml")
    parser.add_argument(
        "--list", action="store_true", help="list the commands and their figures, run nothing"
    )
    chosen = parser.parse_args()
    ties = read_ties(REPOSITORY / "docs" / "figures.toml")
    if chosen.only is not None and chosen.only not in ties.commands:
        parser.error(f"--only: must be one of {', '.join(ties.commands)}, got {chosen.only!r}")
    commands = {name: each for name, each in ties.commands.items() if chosen.only in (None, name)}
    if chosen.list:
        _list(ties, commands)
        return 0
    folder = REPOSITORY / "out" / "figures" / _digest()
    folder.mkdir(parents=True, exist_ok=True)
    values = outputs(commands, ties, folder)
    lines, changed = compared([each for each in ties.tied() if each.command in values], ties, values)
    print("\n".join(lines))
    failed = [name for name in commands if name not in values]
    print(f"{changed} changed" + (f"; failed: {', '.join(failed)}" if failed else ""))
    return 1 if changed or failed else 0


def outputs(commands: dict[str, Command], ties: Ties, folder: Path) -> dict[str, Values]:
    """What each command printed, from `folder` or by running it; without those that failed."""
    found: dict[str, Values] = {}
    left = {name: command for name, command in commands.items() if not (folder / f"{name}.json").exists()}
    done_minutes, began = 0.0, time.monotonic()
    all_minutes = sum(command.minutes for command in left.values())
    for name, command in commands.items():
        path = folder / f"{name}.json"
        if name in left:
            # This machine's own pace, once something has run.
            spent = (time.monotonic() - began) / 60.0
            pace = spent / done_minutes if done_minutes else 1.0
            remaining = pace * (all_minutes - done_minutes)
            print(
                f"{done_minutes / all_minutes:.0%}, about {remaining:.0f} min left: {name}",
                file=sys.stderr,
                flush=True,
            )
            _run(command, path, ties)
            done_minutes += command.minutes
        if path.exists():
            found[name] = json.loads(path.read_text(encoding="utf-8"))
    return found


def compared(tied: list[Tied], ties: Ties, values: dict[str, Values]) -> tuple[list[str], int]:
    """The table `document, figure, was, is, changed`, and how many changed."""
    lines = ["| document | figure | was | is | changed |", "|---|---|---|---|---|"]
    changed = 0
    for each in tied:
        text = ties.text(each.document)
        place = f"{each.document}:{text.count(chr(10), 0, each.start) + 1}"
        try:
            value = evaluated(each.row, values[each.command])
        except KeyError:
            shown, differs = "no row", True
        else:
            shown = "–" if value is None else f"{value:.{decimals(each.shown)}f}"
            differs = has_changed(each.shown, value, ties.commands[each.command].tolerance)
        changed += differs
        lines.append(f"| {place} | {each.row} | {each.shown} | {shown} | {'yes' if differs else ''} |")
    return lines, changed


def _run(command: Command, path: Path, ties: Ties) -> None:
    """Run a command's lines in turn, and write the figures that they printed into `path`."""
    lines = command.run or [example.command for example in examples(ties.text(command.page))]
    printed = []
    for line in lines:
        done = subprocess.run(
            _argv(line),
            cwd=REPOSITORY,
            stdout=subprocess.PIPE,
            text=True,
            check=False,
            env=os.environ | {"COLUMNS": str(COLUMNS)},
        )
        if done.returncode:
            print(f"{line}: exit code {done.returncode}", file=sys.stderr)
            return
        printed.append(done.stdout)
    if command.page:
        values = {k: v for index, text in enumerate(printed) for k, v in example_values(index, text).items()}
    elif command.keys:
        values = markdown_values(printed[-1], command.keys)
    else:
        values = row_values(json.loads(printed[-1])["rows"])
    # What exists is not run again.
    write_text_whole(path, json.dumps(values) + "\n")


def _argv(line: str) -> list[str]:
    program, *arguments = shlex.split(line)
    if program == "vpltune":
        return [sys.executable, "-m", "vpltune", *arguments, *(["--json"] if arguments[0] == "bench" else [])]
    return [sys.executable if program == "python" else program, *arguments]


def _list(ties: Ties, commands: dict[str, Command]) -> None:
    tied = ties.tied()
    for name, command in commands.items():
        count = sum(each.command == name for each in tied)
        what = " && ".join(command.run) or command.page
        print(f"{name}: {what} ({count} figures, about {command.minutes:.0f} min)")


def _digest() -> str:
    digest = hashlib.sha256(program_digest(Path(__file__)).encode())
    for path in sorted((REPOSITORY / "benchmarks").rglob("*.py")):
        digest.update(str(path.relative_to(REPOSITORY)).encode() + path.read_bytes())
    return digest.hexdigest()[:DIGEST_LENGTH]


if __name__ == "__main__":
    sys.exit(main())
