"""Finds the best image within a frame-time budget: predicts by the cost model, then times the runtime."""

import hashlib
import importlib.metadata
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.quality import MetBudget, Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.tuner.evaluation.prepare_scene import PreparedScene
from vpltune.tuner.fitting.fit_density import (
    FEW_VPLS,
    HELD_OUT_ROTATIONS,
    ROTATIONS,
    DensityFit,
    fit_density,
    rotated_views,
    rotation_errors,
    table_rotations,
    with_discs,
)
from vpltune.tuner.fitting.fit_placement import fit_placement
from vpltune.tuner.fitting.fit_status import Descent
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.frame_time.cost_model import (
    COUNTS,
    INTERLEAVES,
    MAP_SIZES,
    CostModel,
    block_side,
    costs_key,
    default_choice,
    measured_cost_model,
    rsm_resolutions,
)

AIM = 0.97
"""Share of the budget that the frame time is set to; the rest absorbs timing noise. A choice."""
LEAST, MOST = 0.93, 1.0
"""Shares of the budget between which a measured frame time is accepted. A choice."""
OVER = 1.05
"""Share of the budget above which a frame is never accepted, not even after all tries. A choice."""
TRIES = 10
"""Most VPL counts that are timed to meet a budget. A choice."""
FRAMES, MOST_FRAMES = 3, 100
"""Least and most frames of a timing, of which the median is taken. A choice."""
TIMED = 500.0
"""Milliseconds of frames in the final timings, within the limits above. A choice: other load on the machine
seldom lasts less."""
LEVEL_FRAMES = 15
"""Frames timed at each VPL count to scale the cost model to the machine's present speed. A choice."""
SHADOW_SHARE = 0.25
"""Share of the budget that RSM and VPL placement may take before a coarser RSM is used. A choice: with a
half, more time went to a finer RSM alone, and the indirect light was worse than with less."""
LEAST_COUNT = 4
"""VPLs for each pixel of a block, below which a budget counts as too small. A choice."""
CHOICES = ("interleave", "map_size", "rsm_resolution")
"""Quality settings that a budget chooses."""
CHOICE_ROTATIONS = 3
"""Rotations of the point table that the quality settings are compared on. A choice."""
GUESSED_IMPORTANCE = 0.75
"""η until it is fitted. A choice: the cost of importance does not depend on η."""
_CHOSEN, _FITTED = 0.25, 0.9
"""Progress after the quality settings are chosen, and after density and falloff are fitted."""

Progress = Callable[[float], None]
"""Called with the share of the work done, in [0, 1]."""


@dataclass(frozen=True)
class SettledFrame:
    """Quality settings and a VPL count whose measured frame time meets the budget."""

    choice: Quality
    vpl_count: int
    milliseconds: float
    """Measured frame time."""
    tries: int
    """Timings that it took."""


@dataclass(frozen=True, eq=False)
class BudgetFit:
    """The fit for one budget."""

    budget: float
    """Milliseconds."""
    frame: SettledFrame
    predicted: float
    """Frame time by the cost model [ms]."""
    parameters: ArtistParameters
    descent: Descent
    relmse: float
    """Mean relMSE of the drawn images over fitted views and held-out rotations."""
    frame_size: tuple[int, int]
    """Width and height of the timed frames, in pixels."""
    machine: str
    """Name of the OpenGL renderer."""

    def config(self, start: TunedConfig) -> TunedConfig:
        """`start` with the fitted parameters and quality; it draws the frames that were measured."""
        met = MetBudget(self.budget, self.frame_size, self.machine)
        return replace(start.with_parameters(self.parameters), quality=replace(self.frame.choice, budget=met))

    def document(self) -> dict[str, Any]:
        """The key `budget` of metrics.json, and the entries of `pareto`."""
        return {
            "budget_milliseconds": self.budget,
            "milliseconds": self.frame.milliseconds,
            "predicted_milliseconds": self.predicted,
            "relmse": self.relmse,
            "vpl_count": self.frame.vpl_count,
            "choice": {name: getattr(self.frame.choice, name) for name in CHOICES},
            "tries": self.frame.tries,
        }


class FrameBudget:
    """Fits a prepared scene to frame-time budgets at one frame size.

    The frame time is that of the slowest fitted view.

    Args:
        prepared: the scene; at least one of its fitted views is lit.
        start: where fits begin; has no prior.
        frame_size: width and height of the timed frames, in pixels.
        seed: selects pixels and rotations.
        progress: called with the share of the cost model measured, in [0, 1].

    Raises:
        MachineError: the GPU ran out of memory or reported an error.
    """

    def __init__(
        self,
        prepared: PreparedScene,
        start: TunedConfig,
        frame_size: tuple[int, int],
        *,
        seed: int = 0,
        progress: Progress | None = None,
    ):
        self._prepared = prepared
        self._seed = seed
        fitted = [view for view in prepared.views if view.view.split == "fitted"]
        # An unlit view has no error to measure, but it takes time to draw.
        self._views = tuple(view for view in fitted if view.lit)
        self._timed = tuple(replace(view.view, size=frame_size) for view in fitted)
        guessed = replace(with_discs(start.parameters), density_importance=GUESSED_IMPORTANCE)
        self._start = replace(start, parameters=guessed)
        self._runtime = prepared.runtime
        self.default_choice = default_choice(self._timed[0])
        measured = measured_cost_model(prepared.scene, self._timed, self._start, prepared.runtime, progress)
        self.costs: CostModel = measured.scaled(self._level(measured))

    def least_milliseconds(self) -> float:
        """The least budget [ms]: the fastest settings, with `LEAST_COUNT` VPLs for each pixel of a block."""
        return min(
            self.costs.milliseconds(choice, LEAST_COUNT * block_side(choice) ** 2) / AIM
            for choice in self._choices(0.0)
        )

    def fit(self, budget: float, progress: Progress | None = None) -> BudgetFit:
        """Find the settings and parameters with the least error within `budget` milliseconds.

        Raises:
            InputError: no settings are predicted to be that fast, or none were when measured.
        """
        report = progress or (lambda share: None)
        choice = self._best_choice(budget, lambda share: report(_CHOSEN * share))
        frame = self._settle(choice, budget)
        start = replace(self._start.parameters, vpl_count=frame.vpl_count)
        fit = self._fitted(choice, start, lambda share: report(_CHOSEN + (_FITTED - _CHOSEN) * share))
        # Settle again: with η = 0 a frame is faster. The falloff does not change the frame time.
        settled = self._settle(choice, budget, fit.parameters)
        parameters = replace(fit.parameters, vpl_count=settled.vpl_count)
        if abs(settled.vpl_count - frame.vpl_count) > 0.1 * frame.vpl_count:
            parameters = self._falloff_at(choice, parameters)
        rotations = table_rotations(HELD_OUT_ROTATIONS, self._seed, held_out=True)
        config = self._config(settled.choice, parameters)
        errors = rotation_errors(self._runtime, self._views, config, rotations)
        predicted = self.costs.milliseconds(settled.choice, settled.vpl_count)
        report(1.0)
        return BudgetFit(
            budget,
            settled,
            predicted,
            parameters,
            fit.descent,
            float(errors.mean()),
            self._timed[0].size,
            self._runtime.opengl_renderer,
        )

    def content_key(self) -> str:
        """Hash of everything that fits depend on, except the machine's present speed."""
        renderer = self._prepared.runtime.opengl_renderer
        parts = [
            costs_key(renderer, self._prepared.scene, self._timed, self._start),
            importlib.metadata.version("vpltune"),
            self._start.parameters.as_dict(),
            self._seed,
        ]
        digest = hashlib.sha256(json.dumps(parts).encode())
        for view in self._views:
            for half in (view.reference.irradiance_a, view.reference.irradiance_b):
                digest.update(f"{half.shape};".encode())
                digest.update(np.ascontiguousarray(half).tobytes())
        return digest.hexdigest()

    def milliseconds(self, choice: Quality, parameters: ArtistParameters, frames: int = FRAMES) -> float:
        """Frame time of the slowest view, measured now: the median of `frames` frames."""
        config = self._config(choice, parameters)
        return max(self._runtime.frame_milliseconds(view, config, frames) for view in self._timed)

    def _level(self, costs: CostModel) -> float:
        """Measured frame time over the model's prediction. Passes overlap in a frame, and the machine's load
        may have changed since the model was cached."""
        choice = self.default_choice
        measured = sum(
            self.milliseconds(choice, replace(self._start.parameters, vpl_count=count), LEVEL_FRAMES)
            for count in COUNTS
        )
        return measured / sum(costs.milliseconds(choice, count) for count in COUNTS)

    def _choices(self, budget: float) -> list[Quality]:
        """All combinations of interleaving and map size, with the finest RSM within `SHADOW_SHARE`."""
        given = self._start.quality
        maps = MAP_SIZES if self._start.visibility == "maps" else (given.map_size,)
        resolutions = rsm_resolutions(self._timed[0])
        resolution = next(
            (each for each in resolutions if self._rsm_milliseconds(each) <= SHADOW_SHARE * budget),
            resolutions[-1],
        )
        return [
            replace(given, interleave=interleave, map_size=size, rsm_resolution=resolution, budget=None)
            for interleave in INTERLEAVES
            for size in maps
        ]

    def _rsm_milliseconds(self, resolution: int) -> float:
        names = ("reflective_shadow_map", "vpl_importance", "virtual_point_lights")
        costs = self.costs.rsm_resolution[resolution]
        return sum(costs[name].fixed for name in names if name in costs)

    def _best_choice(self, budget: float, progress: Progress) -> Quality:
        """The settings with which the start's parameters have the least error, at the VPL count that the
        budget allows."""
        rotations = table_rotations(CHOICE_ROTATIONS, self._seed)
        errors = {}
        choices = self._choices(budget)
        for index, choice in enumerate(choices):
            progress(index / len(choices))
            count = min(self.costs.count_within(choice, AIM * budget), parameter_spec("vpl_count").high)
            if count < LEAST_COUNT * block_side(choice) ** 2:
                continue  # each pixel of a block needs VPLs of its own
            parameters = replace(self._start.parameters, vpl_count=int(count))
            config = self._config(choice, parameters)
            errors[choice] = rotation_errors(self._runtime, self._views, config, rotations).mean()
        if not errors:
            raise InputError(
                f"--budget-ms: must be at least {self.least_milliseconds():.3g} on this machine for "
                f"frames of {self._timed[0].size[0]}x{self._timed[0].size[1]}, got {budget:g}"
            )
        return min(errors, key=lambda choice: errors[choice])

    def _settle(
        self, choice: Quality, budget: float, parameters: ArtistParameters | None = None
    ) -> SettledFrame:
        """Adjust the VPL count until the measured frame time meets the budget.

        With the final `parameters`, a count must meet it in two timings: of many tries, one would pass by
        chance. If no count is accepted in `TRIES` timings, the largest one within `OVER` is returned.

        Raises:
            InputError: no timing was within `OVER` of the budget.
        """
        chosen = self._start.parameters if parameters is None else parameters
        least, most = LEAST_COUNT * block_side(choice) ** 2, int(parameter_spec("vpl_count").high)
        expected = self.costs.count_within(choice, AIM * budget)
        wanted = expected if parameters is None else parameters.vpl_count
        slope, measured = self.costs.per_vpl(choice), {}
        final = parameters is not None
        frames = int(np.clip(TIMED / budget, FRAMES, MOST_FRAMES)) if final else FRAMES
        for attempt in range(TRIES):
            count = int(np.clip(round(wanted), least, most))
            taken = self.milliseconds(choice, replace(chosen, vpl_count=count), frames)
            confirmed = count in measured
            # The machine's load changes: average the two timings of a count.
            measured[count] = 0.5 * (taken + measured[count]) if confirmed else taken
            if not LEAST * budget <= measured[count] <= MOST * budget:
                slope = _slope(measured, slope)
                wanted = max(count + (AIM * budget - measured[count]) / slope, 0.25 * count)
            elif confirmed or not final:
                return SettledFrame(choice, count, measured[count], attempt + 1)
        fitting = {count: taken for count, taken in measured.items() if taken <= OVER * budget}
        if not fitting:
            raise InputError(
                f"--budget-ms: no frame could be measured within {budget:g} ms; "
                f"the fastest took {min(measured.values()):.3g}"
            )
        best = max(fitting, key=lambda count: fitting[count])
        return SettledFrame(choice, best, fitting[best], TRIES)

    def _fitted(self, choice: Quality, start: ArtistParameters, progress: Progress | None) -> DensityFit:
        # With more VPLs, rotations differ less, so fewer are needed: the work stays that of `FEW_VPLS`.
        rotations = int(np.clip(ROTATIONS * FEW_VPLS // start.vpl_count, 2, ROTATIONS))
        return fit_density(
            self._runtime,
            self._views,
            self._config(choice, start),
            seed=self._seed,
            rotations=table_rotations(rotations, self._seed),
            progress=progress,
        )

    def _falloff_at(self, choice: Quality, parameters: ArtistParameters) -> ArtistParameters:
        rotations = table_rotations(HELD_OUT_ROTATIONS, self._seed)
        config = self._config(choice, parameters).with_full_gather()
        captured = rotated_views(self._runtime, self._views, config, rotations)
        errors = robust_errors(captured, seed=self._seed)
        return fit_placement(captured, parameters, errors, seed=self._seed).parameters

    def _config(self, choice: Quality, parameters: ArtistParameters) -> TunedConfig:
        return replace(self._start, parameters=parameters, quality=choice, auto=None)


def _slope(measured: dict[int, float], model: float) -> float:
    """Milliseconds per VPL between the extreme measured counts, limited to 0.3 to 3 times the model's."""
    low, high = min(measured), max(measured)
    if high < 1.2 * low:
        return model
    return float(np.clip((measured[high] - measured[low]) / (high - low), 0.3 * model, 3.0 * model))
