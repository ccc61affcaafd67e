"""A light carried from a small room into a hall: with `auto` nothing jumps, and nothing stays as it was."""

import numpy as np

from benchmarks.quality.carried_light import auto_runtime, carried_light, drawn_places
from vpltune.renderer.frame.passes.auto_parameters import LARGEST_STEP

FRAMES = 40


def test_no_parameter_jumps(gl_context):
    """Even at a quarter of the clip's frames, each moves by at most `LARGEST_STEP` of its axis a frame."""
    clip = carried_light((48, 27), FRAMES)
    runtime = auto_runtime(clip, context=gl_context, rsm_resolution=128)
    places = []
    for view in clip.views:
        runtime.draw(view)
        places.append(drawn_places(runtime))
    steps = np.abs(np.diff(places, axis=0))
    # 2e-6: places are found again from float32 values.
    assert steps.max() <= LARGEST_STEP + 2e-6
    assert np.abs(places[-1] - places[0]).max() > LARGEST_STEP
