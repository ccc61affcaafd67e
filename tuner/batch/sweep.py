"""What killed processes left in a batch folder, taken away while nobody can be at work on it."""

import shutil
from pathlib import Path

from vpltune.tuner.batch.claim import claimed
from vpltune.tuner.batch.job import claim_path, short_key
from vpltune.tuner.batch.record import Records


def sweep(folder: Path) -> None:
    """Remove temporary files, output folders that no record speaks of, and claims that nobody holds."""
    records = Records(folder)
    for key, path in records.unfinished_files():
        with claimed(claim_path(folder, key)) as mine:
            if mine:
                path.unlink(missing_ok=True)
    outputs = _names(folder / "scenes")
    known = {short_key(key) for key in records.known_keys()} if outputs else set()
    for name in outputs:
        key = name.rpartition("-")[2]
        if key not in known:
            with claimed(claim_path(folder, key)) as mine:
                # Its fit may have ended between the two looks.
                if mine and not any(short_key(full) == key for full in records.known_keys()):
                    shutil.rmtree(folder / "scenes" / name, ignore_errors=True)
    for name in _names(folder / "claims"):
        with claimed(folder / "claims" / name):
            pass  # one that nobody holds goes as it is let go of


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
