"""Auto parameters: a learnt prior, evaluated on the GPU each frame, writes what the gather reads."""

import math

import moderngl
import numpy as np

from vpltune.renderer.config.artist_parameters import parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, AutoPrior
from vpltune.renderer.config.parameter_block import BLOCK_FIELDS
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms

LARGEST_STEP = 0.005
"""Of a parameter's axis, that it moves at most from one eased frame to the next: 3 % of intensity."""

_AXIS_DTYPE = np.dtype([("low", "f4"), ("high", "f4"), ("logarithmic", "i4"), ("place", "i4")])


class AutoParametersPass:
    """Scene statistics, prior → the bound artist parameters.

    `adaptation_frames`: the time constant in frames over which parameters follow what is measured; 0 takes
    it at once. The first frame takes it at once in any case.
    """

    def __init__(self, context: moderngl.Context, prior: AutoPrior, adaptation_frames: float):
        self._context = context
        eased = adaptation_frames > 0.0
        defines = {
            **buffer_bindings.DEFINES,
            "STATISTIC_COUNT": len(STATISTIC_NAMES),
            "AUTO_COUNT": len(AUTO_PARAMETERS),
        }
        self._program = load_compute(context, "auto_parameters/auto_parameters", defines)
        set_uniforms(
            self._program,
            adaptation=1.0 - math.exp(-1.0 / adaptation_frames) if eased else 1.0,
            largest_step=LARGEST_STEP if eased else 1.0,
        )
        self._prior = context.buffer(_prior_bytes(prior))
        self._state = context.buffer(bytes(4 + 4 * len(AUTO_PARAMETERS)))

    def draw(self) -> None:
        """Set the parameters from the statistics, both bound."""
        self._prior.bind_to_storage_buffer(buffer_bindings.AUTO_PRIOR)
        self._state.bind_to_storage_buffer(buffer_bindings.AUTO_STATE)
        self._program.run(1)
        # The parameters may be read back, or set by the program.
        self._context.memory_barrier(
            self._context.SHADER_STORAGE_BARRIER_BIT | self._context.BUFFER_UPDATE_BARRIER_BIT
        )


def _prior_bytes(prior: AutoPrior) -> bytes:
    axes = np.zeros(len(AUTO_PARAMETERS), _AXIS_DTYPE)
    places = {field.name: field.offset // 4 for field in BLOCK_FIELDS}
    for index, name in enumerate(AUTO_PARAMETERS):
        spec = parameter_spec(name)
        axes[index] = (spec.low, spec.high, spec.scale == "log", places[name])
    parts = (prior.weights, prior.bias, prior.lowest, prior.highest)
    return b"".join(np.array(part, np.float32).tobytes() for part in parts) + axes.tobytes()
