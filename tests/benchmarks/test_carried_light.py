"""A lamp carried from a small room into a hall: with `auto`, parameters follow and none of them jumps."""

import numpy as np
import pytest

from benchmarks.quality.carried_light import auto_config, carried_light, drawn_places
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.passes.auto_parameters import LARGEST_STEP
from vpltune.renderer.frame.runtime import Runtime

FRAMES = 40


@pytest.mark.slow
def test_no_parameter_jumps(gl_context):
    """Even at a quarter of the clip's frames, each moves by at most `LARGEST_STEP` of its axis a frame."""
    clip = carried_light((48, 27), FRAMES)
    runtime, config, state = (
        Runtime(clip.scene, context=gl_context),
        auto_config(rsm_resolution=128),
        ClipState(),
    )
    places = [drawn_places(runtime.draw(view, config, state)) for view in clip.views]
    steps = np.abs(np.diff(places, axis=0))
    # 2e-6: places are found again from float32 values.
    assert steps.max() <= LARGEST_STEP + 2e-6
    assert np.abs(places[-1] - places[0]).max() > LARGEST_STEP
