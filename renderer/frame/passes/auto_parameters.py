"""Auto parameters: a learnt prior, evaluated on the GPU each frame, writes what the gather reads."""

import math

import numpy as np

from vpltune.renderer.config.artist_parameters import parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, AutoPrior
from vpltune.renderer.config.parameter_block import BLOCK_FIELDS
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES
from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.resources import Resources

LARGEST_STEP = 0.005
"""Share of a parameter's axis that it moves at most from one eased frame to the next: 3 % of intensity."""

_AXIS_DTYPE = np.dtype([("low", "f4"), ("high", "f4"), ("logarithmic", "i4"), ("place", "i4")])
_STATE_BYTES = 4 + 4 * len(AUTO_PARAMETERS)


class AutoParametersPass(FramePass):
    """Scene statistics, prior → the artist parameters.

    A still takes what is measured. A clip follows it with the time constant `adaptation_frames`; its first
    frame, and every frame where that is 0, takes it at once.
    """

    name = "auto_parameters"

    def __init__(self, resources: Resources, prior: AutoPrior, adaptation_frames: float):
        self._resources = resources
        self._eased = adaptation_frames > 0.0
        self._adaptation = 1.0 - math.exp(-1.0 / adaptation_frames) if self._eased else 1.0
        context = resources.context
        resources["auto_prior"] = context.buffer(_prior_bytes(prior))
        self._still = resources["auto_state"] = context.buffer(bytes(_STATE_BYTES))
        self._program = ComputeProgram(
            resources,
            "auto_parameters/auto_parameters",
            {"STATISTIC_COUNT": len(STATISTIC_NAMES), "AUTO_COUNT": len(AUTO_PARAMETERS)},
            reads=("scene_statistics", "auto_prior"),
            writes=("auto_state", "artist_parameters"),
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Set the parameters from the statistics."""
        context, state = self._resources.context, inputs.state
        if state is None:
            self._resources["auto_state"] = self._still
            self._resources.write("auto_state", bytes(_STATE_BYTES))
        else:
            self._resources["auto_state"] = state.buffer(context, "auto_parameters", _STATE_BYTES)
        self._program.dispatch(
            1, adaptation=self._adaptation, largest_step=LARGEST_STEP if self._eased else 1.0
        )


def _prior_bytes(prior: AutoPrior) -> bytes:
    axes = np.zeros(len(AUTO_PARAMETERS), _AXIS_DTYPE)
    places = {field.name: field.offset // 4 for field in BLOCK_FIELDS}
    for index, name in enumerate(AUTO_PARAMETERS):
        spec = parameter_spec(name)
        axes[index] = (spec.low, spec.high, spec.scale == "log", places[name])
    parts = (prior.weights, prior.bias, prior.lowest, prior.highest)
    return b"".join(np.array(part, np.float32).tobytes() for part in parts) + axes.tobytes()
