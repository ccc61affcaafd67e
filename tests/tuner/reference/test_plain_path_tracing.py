"""Plain path tracing has the expectation of the reference estimator, and more noise."""

import numpy as np

from vpltune.tuner.reference.indirect_irradiance import IndirectIrradiance
from vpltune.tuner.reference.plain_path_tracing import PlainPathTracing
from vpltune.tuner.reference.traced_scene import traced_scene

SAMPLES = 256
"""Samples per pixel and half."""


def test_the_mean_is_the_reference_s_and_the_noise_is_not_less(shapes):
    """Tolerance: 24·18 pixels of 512 samples, whose spread is about their mean, know it to 0.2 %."""
    view = shapes.box_room_view((24, 18))
    traced = traced_scene(shapes.box_room())
    means, noise = [], []
    for estimator in (PlainPathTracing, IndirectIrradiance):
        tracer = estimator(traced.wavefront, traced.surfaces, traced.triangles, view)
        half_a, half_b = sum(batch for _, batch in tracer.batches(0, SAMPLES, 3, 1)) / SAMPLES
        means.append(float(half_a.mean() + half_b.mean()) / 2.0)
        noise.append(float(np.mean((half_a - half_b) ** 2)))
    assert abs(means[0] / means[1] - 1.0) < 0.01
    assert noise[0] >= noise[1]
