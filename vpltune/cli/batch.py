"""`vpltune batch`: fits every scene of a library, and writes a record and a tuned config for each."""

import os
import re
import shlex
from collections import Counter
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from vpltune.cli.options import (
    SCENE_SECONDS,
    VIEW_COUNT,
    BouncesOption,
    JsonOption,
    SeedOption,
    StartOption,
    ViewCountOption,
    ViewSizeOption,
    VisibilityOption,
    parse_size,
)
from vpltune.cli.report import OK, PARTLY_DONE, Report, warn
from vpltune.cli.view_options import EnvironmentOption, SkyOption
from vpltune.guard import asked_to_stop
from vpltune.renderer.errors import InputError

if TYPE_CHECKING:
    from vpltune.tuner.batch.batch import BatchResult, Scheduler
    from vpltune.tuner.batch.supervised_process import Limits

RUN_PANEL = "Execution"
SCENE_MEMORY_BYTES = 2 * 2**30
"""Memory to plan for each worker. A choice: twice what a fitting process takes."""
SLURM_TASKS = 64
"""Default number of tasks in a Slurm array. A choice."""
MEMORY_UNITS = {"M": 2**20, "G": 2**30}
"""Bytes of a unit of `--memory-limit`."""


def batch(
    library: Annotated[
        Path,
        typer.Argument(
            metavar="LIBRARY",
            help="A folder, searched recursively for scenes, or a text file with one scene per line.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="DIR", help="Folder for records, log, and each scene's fit."),
    ],
    config: StartOption = "default",
    views: ViewCountOption = VIEW_COUNT,
    size: ViewSizeOption = None,
    seed: SeedOption = 0,
    visibility: VisibilityOption = None,
    bounces: BouncesOption = None,
    sky: SkyOption = None,
    environment: EnvironmentOption = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1024,
            help="Scenes to fit in parallel; by default as many as cores and memory allow.",
            show_default=False,
            rich_help_panel=RUN_PANEL,
        ),
    ] = None,
    threads: Annotated[
        int, typer.Option(min=1, max=1024, help="Cores for each scene.", rich_help_panel=RUN_PANEL)
    ] = 1,
    retries: Annotated[
        int,
        typer.Option(min=0, max=100, help="Further attempts after a scene fails.", rich_help_panel=RUN_PANEL),
    ] = 3,
    retry_failed: Annotated[
        bool, typer.Option(help="Retry scenes that failed in an earlier run.", rich_help_panel=RUN_PANEL)
    ] = False,
    time_limit: Annotated[
        float,
        typer.Option(metavar="SECONDS", help="Stop an attempt after this time.", rich_help_panel=RUN_PANEL),
    ] = SCENE_SECONDS,
    memory_limit: Annotated[
        str | None,
        typer.Option(
            metavar="N[M|G]",
            help="Memory limit of a scene, in MiB or GiB; by default the machine's memory ÷ workers.",
            show_default=False,
            rich_help_panel=RUN_PANEL,
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Run on the workers of a Dask scheduler, tcp://….",
            show_default=False,
            rich_help_panel=RUN_PANEL,
        ),
    ] = None,
    slurm: Annotated[
        str | None,
        typer.Option(
            metavar="KEY=VALUE,…",
            help="Run as a Slurm job array with these parameters of submitit: partition=cpu,timeout_min=240.",
            show_default=False,
            rich_help_panel=RUN_PANEL,
        ),
    ] = None,
    tensorboard: Annotated[
        bool, typer.Option(help="Also write loss curves for TensorBoard.", rich_help_panel=RUN_PANEL)
    ] = False,
    json: JsonOption = False,
) -> Report:
    """Fit every scene of a library. Run it again to resume: finished scenes are not repeated."""
    from vpltune.cli.batch_display import shown_batch
    from vpltune.cli.command_line import command_line
    from vpltune.cli.quality_flags import with_flags
    from vpltune.cli.view_flags import sky_from_flags
    from vpltune.renderer.config.tuned_config import config_text, read_config
    from vpltune.renderer.files.atomic_file import require_writable
    from vpltune.tuner.batch.batch import run_batch
    from vpltune.tuner.batch.job import JobOptions

    start, overridden = with_flags(read_config(config), visibility=visibility, bounces=bounces)
    warn(overridden)
    given = sky_from_flags(sky, environment)
    if given is not None:
        given.environment(None, "--environment")  # one line now, not one for each scene
    options = JobOptions(
        start=config_text(start),
        views=views,
        seed=seed,
        size=None if size is None else parse_size(size),
        sky=None if given is None else given.radiance,
        environment=None if given is None or given.file is None else str(Path(given.file).resolve()),
    )
    if scheduler is not None and slurm is not None:
        raise InputError("--scheduler and --slurm: only one of them can be given")
    elsewhere = scheduler is not None or slurm is not None
    count = workers or (SLURM_TASKS if slurm is not None else _workers_that_fit(threads))
    limits = _limits(time_limit, memory_limit, retries, None if elsewhere else count)
    tasks = None if slurm is None else parse_slurm(slurm)
    require_writable(output)
    with asked_to_stop(), shown_batch(count) as watcher:
        result = run_batch(
            library,
            output,
            options,
            _scheduler(scheduler, tasks, count, threads, limits),
            watcher,
            retry_failed=retry_failed,
            tensorboard=tensorboard,
            command=command_line(),
        )
    return _report(result, output)


def _workers_that_fit(threads: int) -> int:
    """The number of scenes that this machine has cores and memory to fit in parallel."""
    from vpltune.tuner.batch.supervised_process import machine_memory_bytes

    # Only Linux says which cores a process may use.
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(cores // threads, machine_memory_bytes() // SCENE_MEMORY_BYTES))


def _limits(time_limit: float, memory_limit: str | None, retries: int, sharing: int | None) -> "Limits":
    """Limits of an attempt; `sharing` scenes share this machine's memory, None if they run elsewhere."""
    from vpltune.tuner.batch.supervised_process import UNLIMITED_BYTES, Limits, machine_memory_bytes

    if not time_limit > 0.0:
        raise InputError(f"--time-limit: must be a number of seconds above 0, got {time_limit}")
    if memory_limit is not None:
        memory = parse_memory(memory_limit)
    else:
        memory = UNLIMITED_BYTES if sharing is None else machine_memory_bytes() // sharing
    return Limits(time_limit, memory, retries)


def _scheduler(
    address: str | None, slurm: dict[str, str | int] | None, workers: int, threads: int, limits: "Limits"
) -> "Scheduler":
    if address is not None:
        from vpltune.tuner.batch.dask_scheduler import tune_on_dask

        return partial(tune_on_dask, address=address, threads=threads, limits=limits)
    if slurm is not None:
        from vpltune.tuner.batch.slurm_scheduler import tune_on_slurm

        return partial(tune_on_slurm, options=slurm, workers=workers, threads=threads, limits=limits)
    from vpltune.tuner.batch.local_scheduler import tune_locally

    return partial(tune_locally, workers=workers, threads=threads, limits=limits)


def parse_slurm(text: str) -> dict[str, str | int]:
    """Parse parameters such as "partition=cpu,timeout_min=240"; whole numbers become int.

    Raises:
        InputError: a part is not KEY=VALUE.
    """
    parameters: dict[str, str | int] = {}
    for part in filter(None, text.split(",")):
        key, equals, value = part.partition("=")
        if not (key and equals):
            raise InputError(f"--slurm: must be KEY=VALUE separated by commas, got {part!r:.60}")
        parameters[key] = int(value) if value.isdecimal() else value
    return parameters


def parse_memory(text: str) -> int:
    """Parse a size such as "900M" or "4G" into bytes; a number without a unit counts MiB.

    Raises:
        InputError: the text has another form, or the size is zero.
    """
    match = re.fullmatch(r"([0-9]{1,9})([MG]?)", text.upper())
    size = int(match[1]) * MEMORY_UNITS[match[2] or "M"] if match else 0
    if not size:
        raise InputError(f"--memory-limit: must be like 900M or 4G, got {text!r:.60}")
    return size


def _report(result: "BatchResult", output: Path) -> Report:
    from rich.markup import escape
    from rich.table import Table

    from vpltune.tuner.batch.record import Status, as_document

    counts = {status: result.count(status) for status in get_args(Status)}
    partly = counts["failed"] + counts["refused"] > 0
    document = {
        "status": "partly done" if partly else "ok",
        **counts,
        "fitted": result.fitted,
        "copies": result.copies,
        "output": str(output),
        "records": [as_document(record) for record in result.records],
    }
    untuned = [
        record for record in result.records if record.status != "done" or record.fit in ("kept", "doubtful")
    ]
    table = Table(title="Not tuned, or not better than the start", title_justify="left")
    for heading in ("scene", "", "why"):
        table.add_column(heading, overflow="fold")
    for record in untuned:
        table.add_row(escape(record.name), record.fit or record.status, escape(record.reason))
    ended = Counter(record.fit for record in result.records if record.status == "done" and record.fit)
    told = "".join(f"; {count} {fit}" for fit, count in ended.most_common())
    sentence = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
    shown = (
        *((table,) if untuned else ()),
        f"{sentence}; {result.fitted} of them in this run{told}",
        f"records: {escape(str(output / 'records'))}",
        f"report:  {escape(shlex.join(('vpltune', 'report', str(output))))}",
    )
    return Report(document, shown, PARTLY_DONE if partly else OK)
