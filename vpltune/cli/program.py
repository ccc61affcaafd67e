"""The command line, as a function.

Every command returns a `Report`; this module alone prints it, and turns what goes wrong into one
line and an exit code: 0 done, 2 bad input, 3 the machine lacks something, 4 partly done, 130
interrupted.
"""

import contextlib
import errno
import os
import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

import vpltune
from vpltune.cli.any_command import QuietOption, VerboseOption, any_command
from vpltune.cli.batch import batch
from vpltune.cli.bench import bench
from vpltune.cli.command_line import command_arguments
from vpltune.cli.doctor import doctor
from vpltune.cli.evaluate import evaluate
from vpltune.cli.export import export
from vpltune.cli.fit import fit
from vpltune.cli.import_scene import import_scene
from vpltune.cli.init import init
from vpltune.cli.render import render
from vpltune.cli.report import (
    BAD_INPUT,
    DEFECT,
    INTERRUPTED,
    MACHINE_LACKS,
    Report,
    print_json,
    print_report,
    stdout_sent_to_stderr,
)
from vpltune.cli.report_page import report
from vpltune.cli.train_prior import train_prior
from vpltune.cli.verbosity import choose_verbosity, detail, is_verbose, one_line, reset_verbosity
from vpltune.cli.view import view
from vpltune.guard import last_line_printed
from vpltune.renderer.errors import InputError, MachineError

PROGRAM = "vpltune"
CHECKOUT = Path(vpltune.__file__).resolve().parents[1]
"""The repository; for an installed package, the folder that holds all packages."""

app = typer.Typer(
    name=PROGRAM,
    help="Fits indirect light from virtual point lights to a path tracer, and draws with it.",
    epilog="Exit codes: 0 done, 2 bad input, 3 the machine lacks something, 4 partly done, 130 interrupted.",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
COMMANDS = {
    "fit": fit,
    "batch": batch,
    "render": render,
    "evaluate": evaluate,
    "export": export,
    "report": report,
    "train-prior": train_prior,
    "doctor": doctor,
    "bench": bench,
    "import": import_scene,
    "init": init,
    "view": view,
}
for name, command in COMMANDS.items():
    # Benchmarks are not part of the installed package.
    absent = name == "bench" and not (CHECKOUT / "benchmarks" / "harness").is_dir()
    app.command(name, hidden=absent)(any_command(command, name))


def _print_version(wanted: bool) -> bool:
    if wanted:
        print(f"{PROGRAM} {_version(PROGRAM)}")
        raise typer.Exit
    return wanted


@app.callback()
def before_any_command(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """The flags that stand before the command."""
    choose_verbosity(quiet, verbose)


def main() -> int:
    """Run the command line of this process, and return its exit code."""
    # Started with a stream closed, Python has none; the first file opened then stands in its place.
    for stream in ("stdout", "stderr"):
        if getattr(sys, stream) is None:
            setattr(sys, stream, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
    code = run(sys.argv[1:])
    try:
        sys.stdout.flush()
    except OSError:
        # Reported already, if it was a failure; Python must not try again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def run(arguments: Sequence[str]) -> int:
    """Run one command line, print what it reports, and return its exit code."""
    command_arguments.set(tuple(arguments))
    reset_verbosity()
    begin = time.perf_counter()
    # Asked for here and not in the commands, because it holds from before they load anything.
    json_wanted = "--json" in arguments and not {"-h", "--help"} & set(arguments)
    with stdout_sent_to_stderr() if json_wanted else contextlib.nullcontext():
        outcome = _outcome(arguments or ["--help"])
        _tell_details(time.perf_counter() - begin)
    if isinstance(outcome, int):
        return outcome
    if outcome.exit_code == INTERRUPTED:
        last_line_printed()
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
        context = getattr(error, "ctx", None)
        command = PROGRAM if context is None else context.command_path
        return _failure(BAD_INPUT, f"{error.format_message().rstrip('.')}. Try: {command} --help")
    except Exception as error:
        exit_code, explanation = _explained(error)
        if exit_code == DEFECT or is_verbose():
            traceback.print_exc()
        return _failure(exit_code, explanation)


def _explained(error: Exception) -> tuple[int, object]:
    """The exit code of an error, and its one line."""
    if isinstance(error, InputError):
        return BAD_INPUT, error
    if isinstance(error, MachineError):
        return MACHINE_LACKS, error
    if isinstance(error, MemoryError):
        return MACHINE_LACKS, "not enough memory"
    if isinstance(error, OSError):
        full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE, errno.ENOMEM)
        where = f"{error.filename}: " if error.filename is not None else ""
        return MACHINE_LACKS if full else BAD_INPUT, f"{where}{error.strerror or error}"
    return DEFECT, f"a defect of {PROGRAM}, please report it: {type(error).__name__}: {error}"


def _tell_details(seconds: float) -> None:
    """With `--verbose`: what ran, and how long it took."""
    if not is_verbose():
        return
    python = ".".join(map(str, sys.version_info[:3]))
    loaded = [name for name in ("numpy", "moderngl", "jax", "mitsuba", "drjit") if name in sys.modules]
    versions = ", ".join(f"{name} {_version(name)}" for name in (PROGRAM, *loaded))
    detail(f"{versions}, Python {python} on {sys.platform}")
    detail(f"{seconds:.2f} s in all")


def _version(distribution: str) -> str:
    # Takes as long to import as all else that `--help` needs.
    import importlib.metadata

    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "of unknown version"


def _failure(exit_code: int, error: object) -> Report:
    line = one_line(error)
    print(f"{PROGRAM}: {line}", file=sys.stderr)
    status = "interrupted" if exit_code == INTERRUPTED else "failed"
    return Report({"status": status, "error": line}, (), exit_code)
