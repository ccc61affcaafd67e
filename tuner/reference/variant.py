"""Find the Mitsuba variant that works on this machine.

`llvm_ad_rgb` is fast, but an LLVM library too old for the processor makes it abort the whole process at its
first kernel. So a child process tries each LLVM library on the machine, newest first. If none works, the slow
`scalar_rgb` is used. The result is cached until Mitsuba or one of the libraries changes.

Environment variables: VPLTUNE_MITSUBA_VARIANT forces `llvm_ad_rgb` or `scalar_rgb` without a trial;
DRJIT_LIBLLVM_PATH names the only LLVM library to try; VPLTUNE_THREADS sets the number of Dr.Jit threads.
"""

import contextlib
import functools
import hashlib
import importlib.metadata
import json
import logging
import os
import platform
import re
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.cache_folder import cache_folder
from vpltune.renderer.files.unfinished_files import remove_abandoned
from vpltune.tuner.reference.cache import locked

_log = logging.getLogger(__name__)

LIBRARIES_TRIED = 4
"""LLVM libraries to try at most. A choice: each failed trial costs a start of Python and Mitsuba."""
PROBE_SECONDS = 60.0
"""Time limit of one trial. A choice."""
OLDEST_LLVM = 15
"""Mitsuba 3.6 and later reject older LLVM versions."""

# The script of a trial: render one sample, which compiles a kernel.
_PROBE = """
import mitsuba as mi
mi.set_variant("llvm_ad_rgb")
eye = {"type": "perspective", "film": {"type": "hdrfilm", "width": 8, "height": 8}}
lit = {"type": "scene", "eye": eye, "lamp": {"type": "point"}, "ball": {"type": "sphere"}}
lit["integrator"] = {"type": "path"}
assert mi.render(mi.load_dict(lit), spp=1).numpy().shape == (8, 8, 3)
"""


@dataclass(frozen=True)
class MitsubaVariant:
    """The Mitsuba variant in use, and why."""

    name: Literal["llvm_ad_rgb", "scalar_rgb"]
    libllvm: str | None
    """Path of the LLVM library; None for the scalar variant, or if Dr.Jit is to find one itself."""
    sentence: str
    """The reason, for the user."""


def describe_variant() -> MitsubaVariant:
    """The variant that references are rendered with here. This process does not load Mitsuba to find out.

    Raises:
        InputError: VPLTUNE_MITSUBA_VARIANT is neither `llvm_ad_rgb` nor `scalar_rgb`.
    """
    return _chosen_variant(os.environ.get("VPLTUNE_MITSUBA_VARIANT"), os.environ.get("DRJIT_LIBLLVM_PATH"))


def select_variant() -> MitsubaVariant:
    """Load Mitsuba and set the variant that `describe_variant` returns.

    Raises:
        InputError: VPLTUNE_MITSUBA_VARIANT is neither `llvm_ad_rgb` nor `scalar_rgb`.
    """
    variant = describe_variant()
    if variant.libllvm is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = variant.libllvm
    import mitsuba

    if mitsuba.variant() != variant.name:
        mitsuba.set_variant(variant.name)
        _log.debug("%s", variant.sentence)
        threads = os.environ.get("VPLTUNE_THREADS", "")
        if threads.isdecimal() and int(threads) > 0:
            import drjit

            drjit.set_thread_count(int(threads))
    return variant


@functools.cache
def _chosen_variant(forced: str | None, named_library: str | None) -> MitsubaVariant:
    if forced == "scalar_rgb":
        return MitsubaVariant(
            "scalar_rgb", None, "VPLTUNE_MITSUBA_VARIANT asks for the slow scalar_rgb variant."
        )
    if forced == "llvm_ad_rgb":
        return MitsubaVariant("llvm_ad_rgb", named_library, "VPLTUNE_MITSUBA_VARIANT asks for llvm_ad_rgb.")
    if forced:
        raise InputError(f"VPLTUNE_MITSUBA_VARIANT: must be llvm_ad_rgb or scalar_rgb, got {forced!r}")
    # None comes last: Dr.Jit searches by itself and may know places that we do not.
    libraries: list[str | None]
    libraries = [named_library] if named_library else [*map(str, llvm_libraries()[:LIBRARIES_TRIED]), None]
    path = cache_folder() / "mitsuba_variant.json"
    key = _machine_key(libraries)
    kept = _kept_variant(path, key)
    if kept is not None:
        return kept
    with locked("mitsuba_variant"):
        # Another process may have stored the result while this one waited for the lock.
        kept = _kept_variant(path, key)
        if kept is not None:
            return kept
        variant, certain = _probed_variant(libraries)
        with contextlib.suppress(OSError, InputError, MachineError):
            remove_abandoned(path.parent)
            if certain:
                write_text_whole(path, json.dumps({"key": key, "variant": asdict(variant)}) + "\n")
    return variant


def _kept_variant(path: Path, key: str) -> MitsubaVariant | None:
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return MitsubaVariant(**kept["variant"]) if kept["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def llvm_libraries() -> list[Path]:
    """Paths of the shared LLVM libraries in the usual folders, newest version first."""
    folders = [
        *map(Path, filter(None, os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep))),
        Path(sys.prefix) / "lib",
        *(Path("/usr/lib") / f"{platform.machine()}-linux-gnu", Path("/usr/lib64"), Path("/usr/lib")),
        *(Path("/usr/local/lib"), *sorted(Path("/usr/lib").glob("llvm*/lib"))),
        *sorted(Path("/opt/homebrew/opt").glob("llvm*/lib")),
    ]
    found: dict[Path, int] = {}
    for folder in folders:
        for path in folder.glob("libLLVM*"):
            match = re.fullmatch(
                r"libLLVM(?:-|\.so\.)(\d+)[\d.]*(?:\.so[\d.]*)?|libLLVM\.dylib", path.resolve().name
            )
            if match and int(match[1] or OLDEST_LLVM) >= OLDEST_LLVM:
                found[path.resolve()] = int(match[1] or OLDEST_LLVM)
    return sorted(found, key=lambda path: (-found[path], str(path)))


def _probed_variant(libraries: list[str | None]) -> tuple[MitsubaVariant, bool]:
    """The variant, and whether the result may be cached: no trial timed out or failed to start."""
    certain = True
    for library in libraries:
        environment = dict(os.environ) | ({"DRJIT_LIBLLVM_PATH": library} if library else {})
        try:
            probe = subprocess.run(
                [sys.executable, "-P", "-c", _PROBE],
                env=environment,
                capture_output=True,
                timeout=PROBE_SECONDS,
            )
        except (subprocess.TimeoutExpired, OSError):
            certain = False
            continue
        if probe.returncode == 0:
            sentence = f"Mitsuba runs llvm_ad_rgb on {library or 'the LLVM library that Dr.Jit found'}."
            return MitsubaVariant("llvm_ad_rgb", library, sentence), certain
    tried = ", ".join(library for library in libraries if library) or "none found"
    return (
        MitsubaVariant(
            "scalar_rgb",
            None,
            f"Mitsuba falls back to scalar_rgb, some 60 times slower: no LLVM library works here "
            f"(tried: {tried}); LLVM 19 does (Debian: apt-get install libllvm19).",
        ),
        certain,
    )


def _machine_key(libraries: list[str | None]) -> str:
    seen: list[object] = [importlib.metadata.version(name) for name in ("mitsuba", "drjit")]
    seen += [sys.executable, platform.machine()]
    for library in libraries:
        with contextlib.suppress(OSError):
            status = Path(library).stat() if library else None
            seen.append([library, status and [status.st_mtime_ns, status.st_size]])
    with contextlib.suppress(OSError):
        # Machines with different processors may share the cache folder.
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        seen.append(next((line for line in lines if line.startswith(("flags", "Features"))), ""))
    return hashlib.sha256(json.dumps(seen).encode()).hexdigest()
