"""Fuzzes the readers of files: `python -m tests.fuzzing.run --cases 50000 --seed 1`.

Every case is read, or refused in one line that names the file; all else is a finding. Findings are listed by
kind, each with the name of a case, which `--case NAME` repeats; `--keep FOLDER` leaves its files there.
Ctrl-C prints what was found so far, and the option with which the next run goes on.

Exit code: 0 no findings, 1 findings, 130 interrupted.
"""

import argparse
import importlib
import signal
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzzing.cases import READERS, Case, cases
from tests.fuzzing.isolation import Limits, outcomes
from tests.fuzzing.outcomes import Outcome

KEPT_CASES = Path(__file__).parent / "kept_cases.txt"
"""Cases that failed once, one a line."""
_WARM = ("DracoPy", "OpenEXR", "PIL.PngImagePlugin", "PIL.JpegImagePlugin", "PIL.WebPImagePlugin")
_WARM_READERS = ("gltf_scene", "obj_scene", "ply_scene")


@dataclass
class Findings:
    """What came of the cases so far."""

    verdicts: Counter[tuple[str, str]] = field(default_factory=Counter)
    """Number of cases by reader and verdict."""
    kinds: dict[tuple[str, str], list[tuple[Case, Outcome]]] = field(default_factory=dict)
    """Findings by reader and kind."""

    def add(self, case: Case, outcome: Outcome) -> bool:
        """Count a case; whether it is a finding of a new kind."""
        self.verdicts[case.reader, outcome.verdict] += 1
        if outcome.verdict != "finding":
            return False
        alike = self.kinds.setdefault((case.reader, outcome.kind), [])
        alike.append((case, outcome))
        return len(alike) == 1

    def lines(self) -> list[str]:
        """A table of the verdicts, then the findings by kind, each with its first case."""
        shown = [f"{'reader':10}{'read':>9}{'refused':>9}{'findings':>9}"]
        for reader in dict.fromkeys(reader for reader, _ in self.verdicts):
            counts = (self.verdicts[reader, verdict] for verdict in ("read", "refused", "finding"))
            shown.append(f"{reader:10}" + "".join(f"{count:9,}" for count in counts))
        for (reader, kind), found in sorted(self.kinds.items(), key=lambda item: (item[0][0], -len(item[1]))):
            case, outcome = found[0]
            shown.append(f"{len(found)} × {reader}: {kind}")
            shown.append(f"    --case {case}   {outcome.message!r}")
        return shown


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; its exit code."""
    options = _options(arguments)
    # A script ignores it for what it starts in the background.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    _warm_up()
    if options.keep is not None:
        options.keep.mkdir(parents=True, exist_ok=True)
        path, mutated = options.case[0].write(options.keep)
        print(f"{path}: {'changed' if mutated else 'valid as it is'}")
    named = (
        []
        if options.kept or options.case
        else cases(options.reader, options.seed, options.first, options.cases)
    )
    named += options.case + (kept_cases() if options.kept else [])
    findings = Findings()
    interrupted = _run(named, findings)
    print("\n".join(findings.lines()))
    if interrupted:
        done = sum(findings.verdicts.values())
        print(f"interrupted after {done:,} cases; go on with --first {options.first + done}")
        return 130
    return 1 if findings.kinds else 0


def kept_cases() -> list[Case]:
    """The cases that failed once."""
    lines = (line.partition("#")[0].strip() for line in KEPT_CASES.read_text(encoding="utf-8").splitlines())
    return [Case.parse(line) for line in lines if line]


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.fuzzing.run", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--cases", type=int, default=50_000, help="number of cases, over all readers")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="cases to skip, to go on after an interruption")
    parser.add_argument("--reader", action="append", choices=[*READERS], help="only this reader; repeatable")
    parser.add_argument(
        "--case", type=Case.parse, action="append", default=[], help="repeat a case, such as obj:1:7"
    )
    parser.add_argument(
        "--keep", type=Path, help="an empty folder that takes the files of the (first) --case"
    )
    parser.add_argument("--kept", action="store_true", help=f"repeat the cases of {KEPT_CASES.name}")
    options = parser.parse_args(arguments)
    options.reader = options.reader or [*READERS]
    if options.keep is not None and not options.case:
        parser.error("--keep goes with --case")
    return options


def _warm_up() -> None:
    """Load before the forks what a reader loads when it is first used."""
    for name in _WARM:
        importlib.import_module(name)
    for name in _WARM_READERS:
        importlib.import_module(f"vpltune.renderer.scene.files.{name}")


def _run(named: list[Case], findings: Findings) -> bool:
    """Add the outcome of each case to `findings`; whether Ctrl-C ended it."""
    begin = told = time.monotonic()
    shown = outcomes(named, Limits())
    try:
        for done, (case, outcome) in enumerate(shown, 1):
            if findings.add(case, outcome):
                _tell_new(case, outcome)
            now = time.monotonic()
            if now - told >= (1.0 if sys.stderr.isatty() else 30.0):
                told = now
                left = (now - begin) / done * (len(named) - done)
                _tell(f"{done / len(named):4.0%}, {left / 60:.1f} min left, {len(findings.kinds)} kinds")
    except KeyboardInterrupt:
        return True
    finally:
        shown.close()
        if sys.stderr.isatty():
            print(file=sys.stderr)
    return False


def _tell_new(case: Case, outcome: Outcome) -> None:
    start = "\r" if sys.stderr.isatty() else ""
    print(f"{start}{case}: {outcome.kind}", file=sys.stderr, flush=True)


def _tell(line: str) -> None:
    is_terminal = sys.stderr.isatty()
    print(f"\r{line}" if is_terminal else line, end="" if is_terminal else "\n", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
