"""Describes the machine that a benchmark runs on."""

import os
import platform
from pathlib import Path


def machine_description() -> str:
    """Processor, cores, memory, Python and the OpenGL renderer, in one line."""
    return "; ".join(
        [
            f"{_processor()}, {len(os.sched_getaffinity(0))} cores",
            f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GiB",
            f"Python {platform.python_version()}",
            _opengl_renderer(),
        ]
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _opengl_renderer() -> str:
    from vpltune.renderer.errors import MachineError
    from vpltune.renderer.gpu.gpu_context import create_context

    try:
        context = create_context()
    except MachineError:
        return "no OpenGL"
    name = context.info["GL_RENDERER"]
    context.release()
    return str(name)
