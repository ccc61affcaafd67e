"""The extras of the package, as pyproject.toml names them, and whether they are installed.

An installation without extras is the runtime: it draws, exports and imports.
"""

import importlib.util
from collections.abc import Mapping

EXTRA_MODULES: Mapping[str, tuple[str, ...]] = {
    "tuner": (
        "drjit",
        "flip_evaluator",
        "jax",
        "jaxlib",
        "jinja2",
        "matplotlib",
        "mitsuba",
        "optax",
        "psutil",
        "scipy",
    ),
    "ktx": ("opengl_basisu",),
    "cluster": ("distributed", "submitit"),
    "tensorboard": ("tensorboardX",),
}
"""The modules that each extra brings and nothing else does."""


def extra_to_install(error: ImportError) -> str | None:
    """The extra whose absence made an import fail; None where the import failed for another reason."""
    cause: BaseException | None = error
    while cause is not None:
        # jax names only jaxlib in the words of its own error, and has the import's error as the cause.
        if isinstance(cause, ModuleNotFoundError) and cause.name is not None:
            root = cause.name.partition(".")[0]
            extras = [extra for extra, modules in EXTRA_MODULES.items() if root in modules]
            if extras and not is_installed(root):
                return extras[0]
        cause = cause.__cause__ or cause.__context__
    return None


def missing_modules(extra: str) -> tuple[str, ...]:
    """The modules of an extra that are not installed."""
    return tuple(module for module in EXTRA_MODULES[extra] if not is_installed(module))


def is_installed(module: str) -> bool:
    """Whether a top-level module can be found. It is not imported."""
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def how_to_install(*extras: str) -> str:
    """The command that installs extras."""
    return f'pip install "vpltune[{",".join(extras)}]"'
