"""Whether JAX can start on the platform that the environment names."""

import os

import jax

from vpltune.renderer.errors import MachineError

VARIABLE = "JAX_PLATFORMS"
"""JAX's own variable: the platforms to try, in order."""


def require_jax_platform() -> None:
    """Start JAX.

    Raises:
        MachineError: it cannot start on what `JAX_PLATFORMS` names.
    """
    try:
        jax.devices()
    # JAX raises RuntimeError for an unknown platform, and AssertionError for a known one without its plugin.
    except (RuntimeError, AssertionError) as error:
        reason = (str(error) or "no such device").splitlines()[0]
        named = os.environ.get(VARIABLE, "")
        raise MachineError(f"{VARIABLE}={named}: JAX cannot start ({reason}); unset it") from error
