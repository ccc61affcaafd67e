"""The card of a learnt prior: training scenes, error on unseen scenes, and the scenes where it is worst."""

import numpy as np

from vpltune.renderer.config.artist_parameters import parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.tuner.prior.prior_library import CONFIG, FITTED, HELD_OUT, VIEW_SIZE
from vpltune.tuner.prior.prior_training import FLOOR, FOLDS, LearntPrior

WORST = 8
"""Number of scenes in the list of the worst. A choice."""


# The card's template, in Markdown.
_CARD = """# The prior behind `--config auto`

The prior sets {parameters} in every frame, from {statistics} scene statistics that the GPU measures. This
card and the config were written by

    {command}

It was trained on {scenes} scenes at {counts} VPLs. The command says how many were generated
(`tuner/prior/scene_generator.py`), and which library the others are from. Each scene has {views} views of
{width}×{height} pixels, each with its own light position. Light was reflected {bounces}.

## On unseen scenes

Cross-validation in {folds} groups: each scene was left out of the training of a prior like this one. The loss
is that of a fit (relative, robust against outliers, through the surrogate). `fit` is a fit of the scene
itself, to its fitted views at that VPL count. The table has medians over the scenes, and the share of the
scenes where `auto` beats the defaults, by that loss and by relMSE:

{figures}

## Where it fails

The {worst_count} scenes with the largest ratio of `auto` to `fit`, on held-out views:

{worst}

The prior never leaves these ranges, in which it was trained:

{ranges}
{left_out}"""


def prior_card(learnt: "LearntPrior", config: TunedConfig, left_out: dict[str, str]) -> str:
    """The card in Markdown.

    Args:
        learnt: The prior and the losses that it was evaluated by.
        config: The config with the prior; its provenance names the command.
        left_out: Reasons by the name of each scene that was not used.
    """
    return _CARD.format(
        parameters=", ".join(parameter_spec(name).symbol for name in AUTO_PARAMETERS),
        statistics=len(STATISTIC_NAMES),
        command=config.provenance.get("command", "vpltune.tuner.prior.train_prior.train_prior"),
        scenes=len(learnt.scenes),
        views=FITTED + HELD_OUT,
        width=VIEW_SIZE[0],
        height=VIEW_SIZE[1],
        bounces=_times(CONFIG.light.most_bounces),
        counts=", ".join(map(str, learnt.fits.vpl_counts)),
        folds=FOLDS,
        figures=_figures(learnt),
        worst_count=WORST,
        worst=_worst(learnt),
        ranges=_ranges(learnt),
        left_out=_left_out(left_out),
    )


def _times(bounces: int | None) -> str:
    return "any number of times" if bounces is None else "once" if bounces == 1 else f"up to {bounces} times"


def _ratio(learnt: "LearntPrior", of: str, against: str) -> np.ndarray:
    """Ratio of two losses [scenes, counts, splits], with `FLOOR` added to both because of noise."""
    above = {name: np.maximum(learnt.losses[name][0], 0.0) + FLOOR for name in (of, against)}
    return above[of] / above[against]


def _figures(learnt: "LearntPrior") -> str:
    over_fit, default = _ratio(learnt, "auto", "fit"), _ratio(learnt, "default", "fit")
    beats = learnt.losses["auto"] < learnt.losses["default"]
    beats_in_all = learnt.losses["auto"].mean(axis=3) < learnt.losses["default"].mean(axis=3)
    lines = [
        "| VPLs | views | auto / fit | defaults / fit | auto better, by loss | by relMSE |",
        "|---|---|---|---|---|---|",
    ]
    for c, count in enumerate(learnt.fits.vpl_counts):
        for split, views in ((0, "fitted"), (1, "held out")):
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
        low, high = (spec.value_at(ends[index]) for ends in (learnt.prior.lowest, learnt.prior.highest))
        lines.append(f"- {spec.symbol} ({name}): {low:.3g} to {high:.3g}")
    return "\n".join(lines)


def _left_out(left_out: dict[str, str]) -> str:
    if not left_out:
        return ""
    return "\n".join(
        ["", "Files that were not used:", "", *(f"- {n}: {why}" for n, why in left_out.items()), ""]
    )
