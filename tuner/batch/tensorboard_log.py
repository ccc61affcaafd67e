"""TensorBoard logs of a batch: the loss of each scene at every step, and relMSE before and after the fit."""

import contextlib
import datetime
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any


@contextlib.contextmanager
def fit_curves(folder: Path, wanted: bool) -> Iterator[Callable[[dict[str, Any]], None]]:
    """Open the log, and yield a function to call with each `record` event. It does nothing unless `wanted`.

    Raises:
        ImportError: tensorboardX is not installed.
    """
    if not wanted:
        yield lambda record: None
        return
    from tensorboardX import SummaryWriter

    now = datetime.datetime.now(datetime.UTC).strftime("%Y%m%dT%H%M%S")
    with SummaryWriter(str(folder / "tensorboard" / now)) as writer:
        yield lambda record: _add_scene(writer, folder, record)


def _add_scene(writer: Any, folder: Path, record: dict[str, Any]) -> None:
    if not record["output"]:
        return
    metrics = json.loads((folder / record["output"] / "metrics.json").read_text(encoding="utf-8"))
    for step, loss in enumerate(metrics["loss"].get("curve", ())):
        if loss is not None:
            writer.add_scalar(f"loss/{record['name']}", loss, step)
    for split, variants in metrics["metrics"].items():
        for step, variant in enumerate(("default", "tuned")):
            relmse = variants.get(variant, {}).get("relmse")
            if relmse is not None:
                writer.add_scalar(f"relmse_{split}/{record['name']}", relmse, step)
    writer.flush()
