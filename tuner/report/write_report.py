"""Write the page of a fit, or the pages of a library, into its folder."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import require_writable, write_text_whole
from vpltune.tuner.batch.record import Record
from vpltune.tuner.report.batch_folder import BatchFolder, is_batch_folder, read_batch_folder
from vpltune.tuner.report.fit_folder import METRICS, is_fit_folder, read_fit_folder
from vpltune.tuner.report.library_page import library_page
from vpltune.tuner.report.library_rows import TunedRow, UntunedRow, tuned_row
from vpltune.tuner.report.scene_page import scene_page

SCENE_PAGE = "report.html"
"""File name of the page of a fit."""
LIBRARY_PAGE = "index.html"
"""File name of the page of a library."""


@dataclass(frozen=True)
class WrittenPages:
    """The pages that were written, and the problems on the way."""

    pages: tuple[Path, ...]
    """The page to open comes first."""
    problems: tuple[str, ...] = ()
    """One line for each scene whose files could not be read."""


def write_report(folder: Path, progress: Callable[[float], None] = lambda share: None) -> WrittenPages:
    """Write report.html for the folder of a fit, or index.html and a page for each scene for a batch.

    Every page is written atomically. A scene of a batch whose files are damaged has no page. The library's
    page lists it with the reason.

    Args:
        folder: Output folder of a fit or a batch.
        progress: Called with the share of the work done, in [0, 1].

    Raises:
        InputError: the folder is neither, or a file of the fit or the batch's listing cannot be read.
    """
    if folder.is_dir():
        require_writable(folder)
    if is_batch_folder(folder):
        return _write_library(read_batch_folder(folder), progress)
    if not is_fit_folder(folder):
        raise InputError(
            f"{folder}: must be the folder of a fit, with {METRICS}, or of a batch, with records/"
        )
    page = folder / SCENE_PAGE
    write_text_whole(page, scene_page(read_fit_folder(folder)))
    return WrittenPages((page,))


def _write_library(batch: BatchFolder, progress: Callable[[float], None]) -> WrittenPages:
    tuned, untuned, pages, problems = [], [], [], []
    for index, (name, record) in enumerate(batch.records.items()):
        progress(index / len(batch.records))
        try:
            row, page = _scene(batch, name, record)
        except InputError as error:
            problems.append(str(error))
            row, page = UntunedRow(name, "unreadable", str(error), record.attempts, record.seconds), None
        (tuned if isinstance(row, TunedRow) else untuned).append(row)
        if page is not None:
            pages.append(page)
    untuned += [UntunedRow(name, "waiting", "no record yet", None, None) for name in batch.waiting]
    index_page = batch.path / LIBRARY_PAGE
    write_text_whole(index_page, library_page(batch, tuned, untuned))
    progress(1.0)
    return WrittenPages((index_page, *dict.fromkeys(pages)), tuple(problems))


def _scene(batch: BatchFolder, name: str, record: Record) -> tuple[TunedRow | UntunedRow, Path | None]:
    """The row of a scene and the path of its page, or None if it has none."""
    folder = batch.output(record)
    if folder is None:
        if record.status == "done":
            raise InputError(f"{batch.path / record.output / METRICS}: cannot be read (no such file)")
        return UntunedRow(name, record.status, record.reason, record.attempts, record.seconds), None
    fit = read_fit_folder(folder)
    relative = folder.relative_to(batch.path.resolve())
    up = "/".join([".."] * len(relative.parts))
    page = folder / SCENE_PAGE
    write_text_whole(page, scene_page(fit, name=name, library=f"{up}/{LIBRARY_PAGE}"))
    address = quote((relative / SCENE_PAGE).as_posix())
    if record.status != "done":
        return UntunedRow(name, record.status, record.reason, record.attempts, record.seconds, address), page
    return tuned_row(name, record, fit, address), page
