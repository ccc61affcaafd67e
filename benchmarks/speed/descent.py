"""Whether a fit of the falloff ends at the same loss wherever it starts, and how many steps it takes.

Every scene is fitted with four views and the default config, from `STARTS` random points of the unit cube and
from the defaults. From the defaults, Adam (Kingma and Ba 2015) runs too; it moves k by gradient, as it does
the other parameters.
"""

from collections.abc import Callable
from functools import partial
from statistics import median

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import present_scenes
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.tuner.evaluation.prepare_scene import SceneOptions, Stopwatch, prepare_scene
from vpltune.tuner.fitting.descent import Residuals
from vpltune.tuner.fitting.fit_falloff import Data, all_residuals, fit_to
from vpltune.tuner.fitting.fit_placement import fit_placement
from vpltune.tuner.fitting.fit_views import FitView, robust_errors
from vpltune.tuner.fitting.search_space import SearchSpace

STARTS = 64
"""Random starting points. A choice."""
CLOSE = 1e-3
"""Relative distance to the least known loss below which a fit has reached it. A choice."""
ADAM_STEPS = 1000
"""Steps of Adam. A choice: more than it needs."""
ADAM_RATES = (0.01, 0.03, 0.1)
"""Adam's step sizes, in sides of the unit cube. A choice: the fastest of the three counts."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each scene, the share of starts that reach the least known loss, and our steps against Adam's.

    The last rows are the least share, and the median and the largest number of steps over all scenes.
    """
    scenes = present_scenes()
    made = []
    for index, (name, path) in enumerate(scenes.items()):
        progress(f"descent: {name}", index / len(scenes))
        prepared = prepare_scene(
            path, SceneOptions(), TunedConfig(light=ONE_BOUNCE), Stopwatch(), lambda *_: None
        )
        fitted = tuple(view for view in prepared.views if view.view.split == "fitted")
        if any(view.lit for view in fitted):
            ready = fit_placement(fitted, ArtistParameters(), robust_errors(fitted), turns=1).views
            made += scene_rows(name, ready)
    progress("descent", 1.0)
    shares, steps = ([row for row in made if row.name.startswith(kind)] for kind in ("reached", "steps"))
    return [
        *made,
        Row("least_reached", min(row.value for row in shares), "1", "all starts", 1.0),
        *(
            Row(
                f"{word}_steps",
                over(row.value for row in steps),
                "steps",
                f"adam's {word}",
                over(row.against_value for row in steps),
            )
            for word, over in (("median", median), ("most", max))
        ),
    ]


def scene_rows(name: str, views: tuple[FitView, ...]) -> list[Row]:
    """The two rows of the scene `name`, given its views ready to be fitted."""
    default, space = ArtistParameters(), SearchSpace()
    random = np.random.default_rng(0)
    ends = [
        fit_to(views, space.parameters(random.random(len(space.specs)), default))[1].loss
        for _ in range(STARTS)
    ]
    ours = fit_to(views, default)[1]
    data = tuple(view.reduced for view in views)
    offset = sum(view.offset for view in data) / len(data)
    start = jnp.asarray(space.point(default), jnp.float32)
    adams = [
        np.asarray(_adam(all_residuals(space), data, start, rate)) + float(offset) for rate in ADAM_RATES
    ]
    least = min(ours.loss, *ends, *(losses.min() for losses in adams))
    reached = np.mean([end <= least + CLOSE * abs(least) for end in ends])
    return [
        Row(f"reached.{name}", float(reached), "1", f"all {STARTS} starts", 1.0),
        Row(
            f"steps.{name}",
            # The first loss is that of the start, before the closed form of k.
            steps_to(ours.losses[1:], least),
            "steps",
            "adam",
            min(steps_to(losses, least) for losses in adams),
        ),
    ]


def steps_to(losses: Float[np.ndarray, " steps"], least: float) -> float:
    """Steps until the loss is close to `least`; `losses` begins with the loss before any step. Else inf."""
    close = np.flatnonzero(losses <= least + CLOSE * abs(least))
    return float(close[0]) if close.size else float("inf")


@partial(jax.jit, static_argnums=0)
def _adam(residuals: Residuals, data: Data, start: Array, rate: Array) -> Array:
    """The sum of squared residuals before each step of Adam."""
    optimiser = optax.adam(rate)

    def squares(point: Array) -> Array:
        return jnp.sum(residuals(point, data) ** 2)

    def step(state: tuple, _: None) -> tuple[tuple, Array]:
        point, moments = state
        value, slope = jax.value_and_grad(squares)(point)
        change, moments = optimiser.update(slope, moments)
        return (jnp.clip(point + change, 0.0, 1.0), moments), value

    return jax.lax.scan(step, (start, optimiser.init(start)), None, length=ADAM_STEPS)[1]
