"""Writes the page of a fit's folder into it."""

from pathlib import Path

from renderer.atomic_file import write_text_whole
from renderer.errors import InputError
from tuner.report_page.fit_folder import METRICS, is_fit_folder, read_fit_folder
from tuner.report_page.scene_page import scene_page

SCENE_PAGE = "report.html"


def write_report(folder: Path) -> tuple[Path, ...]:
    """Write DIR/report.html, whole or not at all, and return its path.

    Raises:
        InputError: the folder is not one that `fit` made, or a file in it cannot be read.
    """
    if not is_fit_folder(folder):
        raise InputError(f"{folder}: not a folder that fit made (no {METRICS})")
    page = folder / SCENE_PAGE
    write_text_whole(page, scene_page(read_fit_folder(folder)))
    return (page,)
