"""Whether a fit is ever worse than its start, on views and lights that no choice was made on.

The scenes are all shipped and third-party ones, and `GENERATED` scenes of the generator, from a seed that no
choice was made on. Each is fitted as `vpltune fit SCENE` does, once more with `FEW` VPLs, and measured on
`HELD_OUT` held-out views. Results are written to out/fit_never_loses as they come, in a folder named by a
digest of the program: an interrupted run continues with the same command.

`python -m benchmarks.tuning.fit_never_loses` prints the table by scene.
"""

import json
import multiprocessing
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.harness.program_digest import program_digest
from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import REPORTED_SEED, REPOSITORY, present_scenes
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.strict_json import strict_json
from vpltune.tuner.evaluation.guard import UNSEEN

SEED = REPORTED_SEED
"""Seed of the generated scenes."""
GENERATED = 32
"""Generated scenes. A choice."""
HELD_OUT = 4
"""Held-out views. With two, as a fit has by default, a scene's ratio depends mostly on which views these
are."""
FEW = 32
"""VPLs of the second fit. A choice."""
FIGURES = ("relmse", "trimmed_relmse", "flip", "median_error")
CLOSE, FAR = 1.02, 1.10
"""Ratios tuned ÷ start: up to the first a fit is not worse, and no scene may exceed the second. A choice."""
LEAST_SHARE, MOST_KEPT = 0.95, 0.5
"""The least share of ratios up to `CLOSE`, and the largest share of fits that keep the start. A choice."""
WORKERS = 2
"""Fits that run at once, in a process each. A choice."""


@dataclass(frozen=True)
class Cell:
    """One fit of the benchmark."""

    name: str
    scene: str | int
    """A scene's file, or the number of a generated scene."""
    mode: str
    """`default` for the default VPL count, or `few`."""

    @property
    def file(self) -> str:
        """The name of the file with its result."""
        return f"{self.name}.{self.mode}.json"


def cells() -> list[Cell]:
    """All fits in the order in which they run."""
    scenes: dict[str, str | int] = {name: str(path) for name, path in present_scenes().items()}
    scenes |= {f"generated-{number:02d}": number for number in range(GENERATED)}
    return [Cell(name, scene, mode) for mode in ("default", "few") for name, scene in scenes.items()]


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each mode, the worst and median ratios, and the shares of ratios up to 1.02 and of kept starts."""
    results = list(measured(progress))
    return [row for mode in ("default", "few") for row in mode_rows(mode, results)]


def mode_rows(mode: str, results: list[dict[str, Any]]) -> list[Row]:
    """The rows of one mode, from the results of `measured`."""
    lit = [result for result in results if result["mode"] == mode and result["ratios"]]
    ratios = {figure: [result["ratios"][figure] for result in lit] for figure in FIGURES}
    every = [ratio for values in ratios.values() for ratio in values]
    within = sum(ratio <= CLOSE for ratio in every) / len(every)
    kept = sum(result["status"] != "improved" for result in lit) / len(lit)
    return [
        *(Row(f"{mode}.worst_{figure}", max(ratios[figure]), "1", "limit", FAR) for figure in FIGURES),
        *(Row(f"{mode}.median_{figure}", median(ratios[figure]), "1", "limit", 1.0) for figure in FIGURES),
        Row(f"{mode}.share_within_2_percent", within, "1", "limit", LEAST_SHARE),
        Row(f"{mode}.kept_share", kept, "1", "limit", MOST_KEPT),
    ]


def measured(progress: Callable[[str, float], None]) -> Iterator[dict[str, Any]]:
    """The results of all fits (`result_of`), in the order of `cells`; runs the fits that have none yet."""
    folder = REPOSITORY / "out" / "fit_never_loses" / program_digest(Path(__file__))
    wanted = cells()
    left = [cell for cell in wanted if not (folder / cell.file).exists()]
    with multiprocessing.get_context("spawn").Pool(WORKERS, maxtasksperchild=1) as pool:
        for index, name in enumerate(pool.imap_unordered(_measure, [(cell, folder) for cell in left])):
            progress(f"fit_never_loses: {name}", (len(wanted) - len(left) + index + 1) / len(wanted))
    for cell in wanted:
        yield json.loads((folder / cell.file).read_text(encoding="utf-8"))


def _measure(work: tuple[Cell, Path]) -> str:
    # Imported here, in the process that fits.
    from vpltune.renderer.config.tuned_config import TunedConfig
    from vpltune.renderer.export.glb_writer import write_glb
    from vpltune.tuner.prior.scene_generator import generated_scene
    from vpltune.tuner.scene_fit.fit_scene import FitOptions, fit_scene

    cell, folder = work
    scene = folder / "scenes" / f"{cell.name}.glb"
    if isinstance(cell.scene, int):
        write_glb(scene, generated_scene(cell.scene, SEED))
    else:
        scene = Path(cell.scene)
    start = ArtistParameters() if cell.mode == "default" else replace(ArtistParameters(), vpl_count=FEW)
    options = FitOptions(start=TunedConfig(start, light=ONE_BOUNCE), held_out=HELD_OUT)
    document = fit_scene(scene, folder / cell.name / cell.mode, options, lambda *_: None).document
    write_text_whole(folder / cell.file, strict_json(result_of(cell, document)) + "\n")
    return f"{cell.name}, {cell.mode}"


def result_of(cell: Cell, document: dict[str, Any]) -> dict[str, Any]:
    """The part of metrics.json that is kept; `ratios` is empty where no light reaches the held-out views."""
    held_out = document["metrics"]["held_out"]
    default, tuned = held_out["default"], held_out["tuned"]
    lit = default["relmse"] is not None and default["relmse"] == default["relmse"]
    ratios = {f: (tuned[f] + UNSEEN[f]) / (default[f] + UNSEEN[f]) for f in FIGURES} if lit else {}
    return {
        "name": cell.name,
        "mode": cell.mode,
        "status": document["status"],
        "sentence": document["sentence"],
        "ratios": ratios,
        "default": default,
        "tuned": tuned,
        "ceiling": held_out["ceiling"],
        "seconds": document["seconds"],
        "notes": document["notes"],
    }


def table(results: list[dict[str, Any]]) -> str:
    """A Markdown table with the status and the ratios of each fit."""
    lines = [
        "| scene | VPLs | status | " + " | ".join(FIGURES) + " |",
        "|---|---|---|" + "---|" * len(FIGURES),
    ]
    for result in results:
        ratios = [f"{result['ratios'][figure]:.2f}" if result["ratios"] else "–" for figure in FIGURES]
        count = f"{ArtistParameters().vpl_count:,}" if result["mode"] == "default" else str(FEW)
        lines.append(f"| {result['name']} | {count} | {result['status']} | " + " | ".join(ratios) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(list(measured(lambda stage, share: print(f"{share:.0%} {stage}", file=sys.stderr)))))
