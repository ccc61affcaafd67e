"""The card of a learnt prior: what it was trained on, how far off it is elsewhere, and where it fails."""

from typing import TYPE_CHECKING

import numpy as np

from vpltune.renderer.config.artist_parameters import parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, value_at
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.tuner.prior.prior_library import FITTED, HELD_OUT, VIEW_SIZE
from vpltune.tuner.prior.prior_training import FLOOR, FOLDS

if TYPE_CHECKING:
    from vpltune.tuner.prior.train_prior import LearntPrior

WORST = 8
"""Scenes named as those where the prior does worst."""


_CARD = """# The prior behind `--config auto`

Sets {parameters} in every frame, from {statistics} ratios
that the GPU measures of what the light meets and the camera sees. Written with its config by

    {command}

Trained on {scenes} scenes, {views} views each with a light position of its own, {width}×{height} pixels,
at {counts} VPLs: {generated} generated (`tuner/prior/scene_generator.py`), the others from files.

## On scenes that it has not seen

Each scene was left out, in {folds} groups in turn, from a prior trained like this one. The loss is that of a
fit (relative, robust against single pixels, through the surrogate); `fit` is the scene's own, made for its
fitted views at that VPL count. Medians over scenes, and the share of them where `auto` is better than the
defaults, by that loss and by relMSE alone:

{figures}

## Where it fails

The {worst_count} scenes with the largest loss over their own fit's, on views that neither was made for:

{worst}

It never leaves these ranges, in which it was trained:

{ranges}
{left_out}"""


def prior_card(learnt: "LearntPrior", config: TunedConfig, left_out: dict[str, str]) -> str:
    """Markdown."""
    return _CARD.format(
        parameters=", ".join(parameter_spec(name).symbol for name in AUTO_PARAMETERS),
        statistics=len(STATISTIC_NAMES),
        command=config.provenance.get("command", "vpltune.tuner.prior.train_prior.train_prior"),
        scenes=len(learnt.scenes),
        views=FITTED + HELD_OUT,
        width=VIEW_SIZE[0],
        height=VIEW_SIZE[1],
        counts=", ".join(map(str, learnt.fits.vpl_counts)),
        generated=config.provenance["generated"],
        folds=FOLDS,
        figures=_figures(learnt),
        worst_count=WORST,
        worst=_worst(learnt),
        ranges=_ranges(learnt),
        left_out=_left_out(left_out),
    )


def _ratio(learnt: "LearntPrior", of: str, against: str) -> np.ndarray:
    """[scenes, counts, splits], with the noise of references as the floor of both."""
    above = {name: np.maximum(learnt.losses[name][0], 0.0) + FLOOR for name in (of, against)}
    return above[of] / above[against]


def _figures(learnt: "LearntPrior") -> str:
    over_fit, default = _ratio(learnt, "auto", "fit"), _ratio(learnt, "default", "fit")
    beats = learnt.losses["auto"] < learnt.losses["default"]
    beats_in_all = learnt.losses["auto"].mean(axis=3) < learnt.losses["default"].mean(axis=3)
    lines = [
        "| VPLs | views | auto / fit | defaults / fit | better than the defaults | by relMSE |",
        "|---|---|---|---|---|---|",
    ]
    for c, count in enumerate(learnt.fits.vpl_counts):
        for split, views in ((0, "the fit's own"), (1, "others")):
            auto, plain = (np.median(values[:, c, split]) for values in (over_fit, default))
            loss, relmse = beats[:, :, c, split].mean(axis=1)
            lines.append(f"| {count} | {views} | {auto:.3f} | {plain:.3f} | {loss:.0%} | {relmse:.0%} |")
        loss, relmse = beats_in_all[:, :, c].mean(axis=1)
        lines.append(f"| {count} | all | | | {loss:.0%} | {relmse:.0%} |")
    return "\n".join(lines)


def _worst(learnt: "LearntPrior") -> str:
    over_fit = _ratio(learnt, "auto", "fit")[:, :, 1]
    worst = np.argsort(-over_fit.max(axis=1))[:WORST]
    lines = ["| scene | VPLs | loss: auto | fit | defaults |", "|---|---|---|---|---|"]
    for scene in worst:
        count = int(over_fit[scene].argmax())
        auto, fit, plain = (learnt.losses[name][0, scene, count, 1] for name in ("auto", "fit", "default"))
        name, vpls = learnt.scenes[scene].name, learnt.fits.vpl_counts[count]
        lines.append(f"| {name} | {vpls} | {auto:.3f} | {fit:.3f} | {plain:.3f} |")
    return "\n".join(lines)


def _ranges(learnt: "LearntPrior") -> str:
    lines = []
    for index, name in enumerate(AUTO_PARAMETERS):
        spec = parameter_spec(name)
        low, high = (value_at(spec, ends[index]) for ends in (learnt.prior.lowest, learnt.prior.highest))
        lines.append(f"- {spec.symbol} ({name}): {low:.3g} to {high:.3g}")
    return "\n".join(lines)


def _left_out(left_out: dict[str, str]) -> str:
    if not left_out:
        return ""
    return "\n".join(
        ["", "Files that were not used:", "", *(f"- {n}: {why}" for n, why in left_out.items()), ""]
    )
