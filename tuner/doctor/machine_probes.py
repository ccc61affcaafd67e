"""The probes of `vpltune doctor`.

`python -m vpltune.tuner.doctor.machine_probes NAME` prints one finding as JSON.
`tuner.doctor.machine_findings` runs each probe in a separate process.
"""

import ctypes
import json
import os
import platform
import shutil
import sys
from collections.abc import Callable, Mapping

from vpltune.renderer.errors import InputError, MachineError
from vpltune.tuner.doctor.extras import EXTRA_MODULES, how_to_install, missing_modules
from vpltune.tuner.doctor.machine_findings import APT_LLVM, APT_OPENGL, PIP

Said = Mapping[str, str]
"""The fields of a `Finding` that a probe sets: state, detail, fallback, mend."""

OLDEST_PYTHON = (3, 11)
"""From `requires-python` in pyproject.toml."""


def probe_python() -> Said:
    """The Python version."""
    detail = f"{platform.python_version()} at {sys.executable}"
    if sys.version_info < OLDEST_PYTHON:
        return {"state": "missing", "detail": f"{detail}; 3.11 or newer is needed"}
    return {"state": "ok", "detail": detail}


def probe_egl() -> Said:
    """libEGL, which creates OpenGL contexts without a display."""
    try:
        ctypes.CDLL("libEGL.so.1")
    except OSError as error:
        return {"state": "missing", "detail": str(error), "mend": APT_OPENGL}
    return {"state": "ok", "detail": "libEGL.so.1 loads"}


def probe_opengl() -> Said:
    """A headless OpenGL 4.5 context that runs a compute shader correctly."""
    import numpy as np

    from vpltune.renderer.gpu.gpu_context import create_context

    context = create_context()
    source = """
        #version 450
        layout(local_size_x = 64) in;
        layout(std430, binding = 0) buffer Squares { float square[]; };
        void main() { uint i = gl_GlobalInvocationID.x; square[i] = float(i * i); }
    """
    output = context.buffer(reserve=4 * 64)
    output.bind_to_storage_buffer(0)
    context.compute_shader(source).run(1)
    context.finish()
    if not (np.frombuffer(output.read(), np.float32) == np.arange(64.0) ** 2).all():
        return {"state": "missing", "detail": "a compute shader returned wrong values", "mend": APT_OPENGL}
    renderer = context.info["GL_RENDERER"]
    detail = f"{renderer}, OpenGL {context.version_code / 100:.1f}, compute shaders work"
    if any(name in renderer.lower() for name in ("llvmpipe", "softpipe", "swrast")):
        return {
            "state": "fallback",
            "detail": detail,
            "fallback": "Mesa renders on the CPU: the same images, but slower",
        }
    return {"state": "ok", "detail": detail}


def probe_extras() -> Said:
    """The extras that are installed. Without `tuner` there is only the runtime."""
    missing = {extra: modules for extra in EXTRA_MODULES if (modules := missing_modules(extra))}
    parts = {
        "installed": [extra for extra in EXTRA_MODULES if extra not in missing],
        "not installed": [f"{extra} (no {', '.join(modules)})" for extra, modules in missing.items()],
    }
    detail = "; ".join(f"{part}: {', '.join(names)}" for part, names in parts.items() if names)
    if "tuner" in missing:
        return {"state": "missing", "detail": detail, "mend": how_to_install("tuner")}
    return {"state": "ok", "detail": detail}


def probe_jax() -> Said:
    """JAX, which has to compile and differentiate a function."""
    import jax

    from vpltune.tuner.doctor.jax_platform import require_jax_platform

    try:
        require_jax_platform()
    except MachineError as error:
        return {"state": "missing", "detail": str(error), "mend": "unset JAX_PLATFORMS"}
    slope = jax.jit(jax.grad(lambda x: x**3))(2.0)
    if abs(float(slope) - 12.0) > 1e-4:
        return {
            "state": "missing",
            "detail": f"JAX {jax.__version__}: d(x³)/dx at 2 gave {slope}",
            "mend": PIP,
        }
    devices = ", ".join(str(device) for device in jax.devices())
    return {"state": "ok", "detail": f"JAX {jax.__version__} on {devices}"}


def probe_llvm() -> Said:
    """The LLVM libraries that Mitsuba may use."""
    from vpltune.tuner.reference.variant import llvm_libraries

    named = os.environ.get("DRJIT_LIBLLVM_PATH")
    libraries = [named] if named else [str(path) for path in llvm_libraries()]
    if not libraries:
        return {
            "state": "fallback",
            "detail": "no LLVM library found",
            "fallback": "Mitsuba's scalar variant, some 40 times slower",
            "mend": APT_LLVM,
        }
    return {"state": "ok", "detail": ", ".join(libraries)}


def probe_mitsuba() -> Said:
    """The Mitsuba variant that renders the references."""
    import importlib.metadata

    from vpltune.tuner.reference import describe_variant

    variant = describe_variant()
    detail = f"Mitsuba {importlib.metadata.version('mitsuba')}, {variant.name}"
    if variant.name.startswith("llvm"):
        return {"state": "ok", "detail": f"{detail}, {variant.libllvm or 'LLVM found by Dr.Jit'}"}
    return {"state": "fallback", "detail": detail, "fallback": variant.sentence, "mend": APT_LLVM}


def probe_cache() -> Said:
    """The cache folder for references, which must be writable."""
    from vpltune.renderer.files.atomic_file import written_whole
    from vpltune.renderer.files.cache_folder import cache_folder

    folder = cache_folder()
    try:
        with written_whole(folder / "doctor.txt") as temporary:
            temporary.write_text("can be written\n", encoding="utf-8")
        (folder / "doctor.txt").unlink()
    except (InputError, MachineError, OSError) as error:
        return {
            "state": "fallback",
            "detail": str(error),
            "fallback": "references are rendered again every time",
            "mend": "export VPLTUNE_CACHE=/a/folder/that/can/be/written",
        }
    kept = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    free = shutil.disk_usage(folder).free
    return {"state": "ok", "detail": f"{folder}: {kept / 2**20:.1f} MiB used, {free / 2**30:.1f} GiB free"}


# The probes by the name that the command line takes.
PROBE_FUNCTIONS: Mapping[str, Callable[[], Said]] = {
    "python": probe_python,
    "egl": probe_egl,
    "opengl": probe_opengl,
    "extras": probe_extras,
    "jax": probe_jax,
    "llvm": probe_llvm,
    "mitsuba": probe_mitsuba,
    "cache": probe_cache,
}

if __name__ == "__main__":
    print(json.dumps(PROBE_FUNCTIONS[sys.argv[1]]()))
