"""The command line: `vpltune`, also `python -m tuner`.

Every command returns a `Report`; this module alone prints it, and turns what goes wrong into one
line and an exit code: 0 done, 2 bad input, 3 the machine lacks something, 4 partly done, 130
interrupted.
"""

import contextlib
import errno
import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

import typer

from vpltune.cli.batch import batch
from vpltune.cli.bench import bench
from vpltune.cli.command_line import command_arguments
from vpltune.cli.doctor import doctor
from vpltune.cli.evaluate import evaluate
from vpltune.cli.export import export
from vpltune.cli.fit import fit
from vpltune.cli.import_scene import import_scene
from vpltune.cli.render import render
from vpltune.cli.report import (
    BAD_INPUT,
    DEFECT,
    INTERRUPTED,
    MACHINE_LACKS,
    Report,
    one_line,
    print_json,
    print_report,
    stdout_sent_to_stderr,
)
from vpltune.cli.report_page import report
from vpltune.cli.train_prior import train_prior
from vpltune.renderer.errors import InputError, MachineError

PROGRAM = "vpltune"

app = typer.Typer(
    name=PROGRAM,
    help="Fits one-bounce indirect light from virtual point lights to a path tracer, and draws with it.",
    epilog="Exit codes: 0 done, 2 bad input, 3 the machine lacks something, 4 partly done, 130 interrupted.",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (fit, batch, render, evaluate, export, report, train_prior, doctor, bench):
    app.command()(command)
# `import` is a word of Python's own.
app.command("import")(import_scene)


def main() -> None:
    """The entry point of the installed command."""
    # Started with stdout closed, Python has none; the first file opened then stands in its place.
    sys.stdout = sys.stdout or Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    code = run(sys.argv[1:])
    try:
        sys.stdout.flush()
    except OSError:
        # Reported already, if it was a failure; Python must not try again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Run one command line, print what it reports, and return its exit code."""
    command_arguments.set(tuple(arguments))
    # Asked for here and not in the commands, because it holds from before they load anything.
    json_wanted = "--json" in arguments and not {"-h", "--help"} & set(arguments)
    with stdout_sent_to_stderr() if json_wanted else contextlib.nullcontext():
        outcome = _outcome(arguments or ["--help"])
    if isinstance(outcome, int):
        return outcome
    try:
        if json_wanted:
            print_json(outcome.document)
        else:
            print_report(outcome)
    except (BrokenPipeError, SystemExit):
        # Whoever read our output has gone, which is no failure; rich leaves by SystemExit then.
        pass
    except OSError as error:
        return _failure(MACHINE_LACKS, f"standard output: {error.strerror}").exit_code
    return outcome.exit_code


def _outcome(arguments: Sequence[str]) -> Report | int:
    """What the command returned, or the report of its failure; an exit code where nothing is to be said."""
    try:
        result = app(list(arguments), prog_name=PROGRAM, standalone_mode=False)
        # typer itself turns Ctrl-C within a command into this number.
        return _failure(INTERRUPTED, "interrupted") if result == INTERRUPTED else result or 0
    except KeyboardInterrupt:
        return _failure(INTERRUPTED, "interrupted")
    except typer.TyperException as error:
        command = error.ctx.command_path if getattr(error, "ctx", None) else PROGRAM
        return _failure(BAD_INPUT, f"{error.format_message().rstrip('.')}. Try: {command} --help")
    except InputError as error:
        return _failure(BAD_INPUT, error)
    except MachineError as error:
        return _failure(MACHINE_LACKS, error)
    except MemoryError:
        return _failure(MACHINE_LACKS, "not enough memory")
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE, errno.ENOMEM)
        where = f"{error.filename}: " if error.filename is not None else ""
        return _failure(MACHINE_LACKS if full else BAD_INPUT, f"{where}{error.strerror or error}")
    except Exception as error:
        traceback.print_exc()
        return _failure(DEFECT, f"a defect of {PROGRAM}, please report it: {type(error).__name__}: {error}")


def _failure(exit_code: int, error: object) -> Report:
    line = one_line(error)
    print(f"{PROGRAM}: {line}", file=sys.stderr)
    status = "interrupted" if exit_code == INTERRUPTED else "failed"
    return Report({"status": status, "error": line}, (), exit_code)


if __name__ == "__main__":
    main()
