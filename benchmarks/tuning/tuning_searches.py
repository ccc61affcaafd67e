"""The ways in which renderers are tuned today: each asks an objective for losses until it is told to stop.

All start from the defaults where they take a start, and know the ranges of the parameter table.
"""

import warnings
from collections.abc import Callable

import cma
import numpy as np
import optuna
from scipy.optimize import minimize

Objective = Callable[[np.ndarray], float]
SEED = 0
GRID_STEPS = 10
GRID_PASSES = 6
"""As XeGTAO's auto-tune: ten steps a setting, six passes, each pass over a narrower range about the best."""
GRID_NARROWING = 0.5
DIFFERENCE = 1e-3
"""Of the cube's side: images are float32, and their loss is good to about 1e-6."""
FIRST_SIGMA = 0.2


def grid_narrowing(objective: Objective, start: np.ndarray) -> None:
    """Setting by setting, the best of ten values; then again over half the range about it."""
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
    """Points drawn evenly from the cube."""
    random = np.random.default_rng(SEED)
    objective(start)
    while True:
        objective(random.random(len(start)))


def optuna_tpe(objective: Objective, start: np.ndarray) -> None:
    """Optuna's tree-structured Parzen estimator (Bergstra et al. 2011), all parameters modelled together."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.TPESampler(seed=SEED, multivariate=True)
    study = optuna.create_study(sampler=sampler)
    names = [f"x{axis}" for axis in range(len(start))]
    study.enqueue_trial(dict(zip(names, map(float, start), strict=True)))
    study.optimize(
        lambda trial: objective(np.array([trial.suggest_float(name, 0.0, 1.0) for name in names])),
        n_trials=100_000,
    )


def cma_es(objective: Objective, start: np.ndarray) -> None:
    """CMA-ES (Hansen and Ostermeier 2001) within the cube, begun anew when it has settled."""
    seed = SEED + 1
    while True:
        options = {"bounds": [0.0, 1.0], "seed": seed, "verbose": -9}
        strategy = cma.CMAEvolutionStrategy(start, FIRST_SIGMA, options)
        while not strategy.stop():
            points = strategy.ask()
            strategy.tell(points, [objective(point) for point in points])
        seed += 1


def finite_differences(objective: Objective, start: np.ndarray) -> None:
    """L-BFGS-B (Byrd et al. 1995) with forward differences; from a random point when it has settled."""
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
