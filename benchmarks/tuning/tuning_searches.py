"""Searches with which renderers are tuned today. Each evaluates an objective until the objective stops it.

They know the ranges of the parameters, as the unit cube. Those that take a starting point begin at `start`.
"""

import warnings
from collections.abc import Callable

import cma
import numpy as np
import optuna
from scipy.optimize import minimize

Objective = Callable[[np.ndarray], float]
SEED = 0
"""Seed of every random search. A choice."""
GRID_STEPS = 10
"""Values that the grid tries for each parameter, as XeGTAO's auto-tune does."""
GRID_PASSES = 6
"""Passes of the grid over all parameters, as in XeGTAO's auto-tune, each over a narrower range."""
GRID_NARROWING = 0.5
"""Width of a pass's range over that of the pass before. A choice."""
DIFFERENCE = 1e-3
"""Step of finite differences in sides of the unit cube. A choice: images are float32, and their loss is good
to about 1e-6."""
FIRST_SIGMA = 0.2
"""Initial step size of CMA-ES in sides of the unit cube. A choice."""
MOST_TRIALS = 100_000
"""Trials that Optuna is asked for: more than it has time for, so that only the objective stops it."""


def grid_narrowing(objective: Objective, start: np.ndarray) -> None:
    """A narrowing grid: the best of ten values for each parameter in turn; then again over half the range."""
    best, width = start.copy(), 1.0
    best_loss = objective(best)
    for _ in range(GRID_PASSES):
        for axis in range(len(start)):
            low = np.clip(best[axis] - width / 2.0, 0.0, 1.0 - width)
            for value in np.linspace(low, low + width, GRID_STEPS):
                tried = best.copy()
                tried[axis] = value
                loss = objective(tried)
                if loss < best_loss:
                    best, best_loss = tried, loss
        width *= GRID_NARROWING


def random_search(objective: Objective, start: np.ndarray) -> None:
    """Random search: points drawn uniformly from the cube."""
    random = np.random.default_rng(SEED)
    objective(start)
    while True:
        objective(random.random(len(start)))


def optuna_tpe(objective: Objective, start: np.ndarray) -> None:
    """Optuna's tree-structured Parzen estimator (Bergstra et al. 2011), with a joint model of parameters."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.TPESampler(seed=SEED, multivariate=True)
    study = optuna.create_study(sampler=sampler)
    names = [f"x{axis}" for axis in range(len(start))]
    study.enqueue_trial(dict(zip(names, map(float, start), strict=True)))
    study.optimize(
        lambda trial: objective(np.array([trial.suggest_float(name, 0.0, 1.0) for name in names])),
        n_trials=MOST_TRIALS,
    )


def cma_es(objective: Objective, start: np.ndarray) -> None:
    """CMA-ES (Hansen and Ostermeier 2001) within the cube; restarts with another seed when it converges."""
    seed = SEED + 1
    while True:
        options = {"bounds": [0.0, 1.0], "seed": seed, "verbose": -9}
        strategy = cma.CMAEvolutionStrategy(start, FIRST_SIGMA, options)
        while not strategy.stop():
            points = strategy.ask()
            strategy.tell(points, [objective(point) for point in points])
        seed += 1


def finite_differences(objective: Objective, start: np.ndarray) -> None:
    """L-BFGS-B (Byrd et al. 1995) with forward differences; restarts at a random point when it converges."""
    random, point = np.random.default_rng(SEED), start
    while True:
        minimize(
            objective, point, method="L-BFGS-B", bounds=[(0.0, 1.0)] * len(start), options={"eps": DIFFERENCE}
        )
        point = random.random(len(start))


SEARCHES: dict[str, Callable[[Objective, np.ndarray], None]] = {
    "optuna_tpe": optuna_tpe,
    "cma_es": cma_es,
    "grid_narrowing": grid_narrowing,
    "random_search": random_search,
    "finite_differences": finite_differences,
}
