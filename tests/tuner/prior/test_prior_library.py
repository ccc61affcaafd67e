"""Cached captures of a scene are valid only as long as a new capture would give the same."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from own_reference import own_reference

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import DEFAULT_OPTIONS
from vpltune.tuner.prior import prior_library
from vpltune.tuner.prior.loss_table import default_point, table_loss
from vpltune.tuner.prior.scene_generator import generated_scene

MOVES = np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 0.1, 0.2, 0.0], [0.05, -0.1, 0.0, -0.3]], np.float32)
"""Offsets from the default point."""
# The values under the present `CAPTURE_VERSION`, printed by the test below.
LOSSES = (0.0011756, 0.0276159, 0.1401515)
STATISTICS = (
    *(0.93764, 0.30191, 0.18823, 0.49189, 0.56506, 0.72337),
    *(0.46811, 0.72909, 0.27898, 0.30831, 0.25846, 0.3125),
)


def test_what_the_runtime_does_otherwise_is_another_capture(monkeypatch):
    scene = generated_scene(0)
    views = prior_library.prior_views(scene)
    before = prior_library._key(scene, views)
    assert prior_library._key(scene, views) == before
    keys = {before}
    for quality in (Quality(map_refinement=1), Quality(map_size=8), Quality(interleave=2)):
        with monkeypatch.context() as patch:
            patch.setattr(prior_library, "CONFIG", replace(prior_library.CONFIG, quality=quality))
            keys.add(prior_library._key(scene, views))
    monkeypatch.setattr(prior_library, "DEFAULT_OPTIONS", replace(DEFAULT_OPTIONS, rsm_filtering=1))
    keys.add(prior_library._key(scene, views))
    assert len(keys) == 5


def test_captures_are_those_of_their_version(gl_context, monkeypatch):
    """A capture gives the recorded values. If this fails, users' caches hold outdated captures: increase
    `CAPTURE_VERSION`, and record the new values here. The tolerance covers the rounding of other drivers."""
    gl_context.__enter__()
    monkeypatch.setattr(prior_library, "ROTATIONS", {32: ((0.0, 0.0),)})
    scene = generated_scene(0)
    views = prior_library.prior_views(scene)[:1]
    through_walls = TunedConfig(visibility="transmittance", quality=Quality(rsm_resolution=128))
    drawn = Runtime(scene, context=gl_context).capture(views[0], through_walls)
    found = prior_library._captured(gl_context, scene, views, (own_reference(drawn),))
    table = jax.tree.map(lambda values: jnp.asarray(values[0]), found.table)
    point = default_point(ArtistParameters())
    losses = [float(table_loss(table, point + move)) for move in MOVES]
    print(losses, [round(float(v), 5) for v in found.statistics[0]])
    np.testing.assert_allclose(losses, LOSSES, rtol=5e-3, atol=1e-4)
    np.testing.assert_allclose(found.statistics[0], STATISTICS, atol=2e-3)
