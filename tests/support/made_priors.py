"""A prior made by hand: every parameter in it follows several statistics, and none stands at a bound."""

import numpy as np

from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, AutoPrior
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES


def made_prior(seed=0, strength=0.15) -> AutoPrior:
    random = np.random.default_rng(seed)

    def rows(values):
        return tuple(tuple(float(value) for value in row) for row in values)

    count = len(AUTO_PARAMETERS)
    return AutoPrior(
        weights=rows(random.normal(0.0, strength, (count, len(STATISTIC_NAMES)))),
        bias=(0.5,) * count,
        lowest=(0.0,) * count,
        highest=(1.0,) * count,
    )
