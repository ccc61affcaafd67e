"""Clean a batch folder of what killed processes left, without disturbing processes that are at work."""

import shutil
from pathlib import Path

from vpltune.renderer.files.unfinished_files import remove_abandoned
from vpltune.tuner.batch.claim import claimed
from vpltune.tuner.batch.job import claim_path, short_key
from vpltune.tuner.batch.record import Records


def sweep(folder: Path) -> None:
    """Delete temporary files, output folders without a record, and claims that no process holds."""
    records = Records(folder)
    for written in (folder, folder / "records"):
        remove_abandoned(written)
    outputs = _names(folder / "scenes")
    known = {short_key(key) for key in records.known_keys()} if outputs else set()
    for name in outputs:
        key = name.rpartition("-")[2]
        if key not in known:
            with claimed(claim_path(folder, key)) as mine:
                # The fit may have ended since the records were listed, so list them again.
                if mine and not any(short_key(full) == key for full in records.known_keys()):
                    shutil.rmtree(folder / "scenes" / name, ignore_errors=True)
    for name in _names(folder / "claims"):
        with claimed(folder / "claims" / name):
            pass  # taking and releasing a claim deletes its file


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
