"""The probes of `vpltune doctor`.

`python -m vpltune.tuner.doctor.machine_probes NAME` prints one finding as JSON. Each probe is run by
`tuner.doctor.machine_findings` in a process of its own.
"""

import ctypes
import json
import os
import platform
import shutil
import sys
from collections.abc import Callable, Mapping

from vpltune.tuner.doctor.extras import EXTRA_MODULES, how_to_install, missing_modules
from vpltune.tuner.doctor.machine_findings import APT_LLVM, APT_OPENGL, PIP

Said = Mapping[str, str]
"""The members of a `Finding` that a probe decides: state, detail, fallback, mend."""

OLDEST_PYTHON = (3, 11)


def probe_python() -> Said:
    """Python itself."""
    detail = f"{platform.python_version()} at {sys.executable}"
    if sys.version_info < OLDEST_PYTHON:
        return {"state": "missing", "detail": f"{detail}; 3.11 or newer is needed"}
    return {"state": "ok", "detail": detail}


def probe_egl() -> Said:
    """The library through which OpenGL comes up without a screen."""
    try:
        ctypes.CDLL("libEGL.so.1")
    except OSError as error:
        return {"state": "missing", "detail": str(error), "mend": APT_OPENGL}
    return {"state": "ok", "detail": "libEGL.so.1 loads"}


def probe_opengl() -> Said:
    """A headless OpenGL 4.5 context whose compute shaders compute."""
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
        return {"state": "missing", "detail": "a compute shader gave wrong numbers", "mend": APT_OPENGL}
    renderer = context.info["GL_RENDERER"]
    detail = f"{renderer}, OpenGL {context.version_code / 100:.1f}, compute shaders work"
    if any(name in renderer.lower() for name in ("llvmpipe", "softpipe", "swrast")):
        return {
            "state": "fallback",
            "detail": detail,
            "fallback": "Mesa draws on the processor: the same images, more slowly",
        }
    return {"state": "ok", "detail": detail}


def probe_extras() -> Said:
    """The extras that are installed. Without `tuner` there is the runtime alone."""
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
    """JAX compiles and differentiates on some device."""
    import jax

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
    """LLVM libraries that Mitsuba could use."""
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
    """The Mitsuba variant that references are made with."""
    import importlib.metadata

    from vpltune.tuner.reference import describe_variant

    variant = describe_variant()
    detail = f"Mitsuba {importlib.metadata.version('mitsuba')}, {variant.name}"
    if variant.name.startswith("llvm"):
        return {"state": "ok", "detail": f"{detail}, {variant.libllvm or 'LLVM found by Dr.Jit'}"}
    return {"state": "fallback", "detail": detail, "fallback": variant.sentence, "mend": APT_LLVM}


def probe_cache() -> Said:
    """The folder where references are kept."""
    from vpltune.renderer.errors import InputError
    from vpltune.renderer.files.atomic_file import written_whole
    from vpltune.tuner.reference.cache import cache_folder

    folder = cache_folder()
    try:
        with written_whole(folder / "doctor.txt") as temporary:
            temporary.write_text("can be written\n", encoding="utf-8")
        (folder / "doctor.txt").unlink()
    except (InputError, OSError) as error:
        return {
            "state": "fallback",
            "detail": str(error),
            "fallback": "references are made anew every time",
            "mend": "export VPLTUNE_CACHE=/a/folder/that/can/be/written",
        }
    kept = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    free = shutil.disk_usage(folder).free
    return {"state": "ok", "detail": f"{folder}: {kept / 2**20:.1f} MiB kept, {free / 2**30:.1f} GiB free"}


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
