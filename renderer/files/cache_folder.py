"""The folder for what can be made again: references, measured times, unsaved changes."""

import os
from pathlib import Path

import platformdirs


def cache_folder() -> Path:
    """The folder that the environment variable VPLTUNE_CACHE names, else vpltune's in the user's cache."""
    named = os.environ.get("VPLTUNE_CACHE")
    return Path(named) if named else Path(platformdirs.user_cache_dir("vpltune", appauthor=False))
