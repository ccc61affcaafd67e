"""The front of error against time, from fits and times that are planted: nothing is drawn."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from vpltune.cli.budget_flags import budget_lines
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import MetBudget, Quality
from vpltune.renderer.config.tuned_config import TunedConfig, read_config
from vpltune.renderer.errors import InputError, MachineError
from vpltune.tuner.fitting.fit_status import Descent, FitStatus
from vpltune.tuner.frame_time import pareto_front as front
from vpltune.tuner.frame_time.cost_model import CostModel, PassCost
from vpltune.tuner.frame_time.fit_budget import Front
from vpltune.tuner.frame_time.frame_budget import BudgetFit, FrameBudget, SettledFrame
from vpltune.tuner.frame_time.pareto_front import fit_front, forget_front
from vpltune.tuner.scene_fit import fit_scene
from vpltune.tuner.scene_fit.fit_result import FitResult

START = TunedConfig(visibility="maps", light=ONE_BOUNCE)


class PlantedBudget(FrameBudget):
    """Frames of 1 ms and 0.01 ms a VPL, with relMSE 1/N but where `errors` has another for the n-th fit."""

    def __init__(self, errors=(), refused=(), interrupted_at=None):
        self.errors, self.refused, self.interrupted_at = dict(errors), refused, interrupted_at
        self.fitted: list[float] = []
        self.timed: list[int] = []
        self.default_choice = Quality(interleave=1, rsm_resolution=1024)
        gather = {"vpl_gather": PassCost(1.0, 0.01)}
        self.costs = CostModel({1: gather}, {}, {self.default_choice.rsm_resolution: {}})

    def least_milliseconds(self):
        return 1.04

    def content_key(self):
        return "planted"

    def fit(self, budget, progress=None):
        if len(self.fitted) == self.interrupted_at:
            raise KeyboardInterrupt
        self.fitted.append(budget)
        if len(self.fitted) - 1 in self.refused:
            raise InputError("--budget-ms: no frame could be measured within it")
        progress(0.5)
        count = round((budget - 1.0) / 0.01)
        return BudgetFit(
            budget,
            SettledFrame(self.default_choice, count, budget, 2),
            budget,
            ArtistParameters(vpl_count=count, intensity=1.0 + 1e-4 * count),
            Descent(np.zeros(3, np.float32), 0.25, 0.5, np.array([0.5, 0.25]), FitStatus.CONVERGED),
            self.errors.get(len(self.fitted) - 1, 1.0 / count),
            (64, 48),
            "planted",
        )

    def milliseconds(self, choice, parameters, frames=7):
        self.timed.append(parameters.vpl_count)
        return 1.0 + 0.01 * parameters.vpl_count


@pytest.fixture(autouse=True)
def own_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("VPLTUNE_CACHE", str(tmp_path / "cache"))


def kept_files(tmp_path):
    return list((tmp_path / "cache" / "fronts").glob("*"))


def assert_monotone(points):
    times = [point.frame.milliseconds for point in points]
    errors = [point.relmse for point in points]
    assert all(a < b for a, b in pairwise(times))
    assert all(a > b for a, b in pairwise(errors))


def test_a_front_is_monotone_and_all_of_it_is_used():
    points = fit_front(PlantedBudget())
    assert len(points) == front.POINTS
    assert_monotone(points)
    assert points[-1].frame.milliseconds == pytest.approx(1.0 + 0.01 * front.DENSEST)


def test_what_another_beats_is_left_out():
    """The third is better than the fourth, which goes, and as good as the fifth, which is slower."""
    points = fit_front(PlantedBudget(errors={2: 0.0025, 3: 0.003, 4: 0.0025}))
    assert [point.relmse for point in points][2] == 0.0025
    assert len(points) == front.POINTS - 2
    assert_monotone(points)


def test_a_front_is_made_of_the_times_that_were_measured_beside_each_other():
    """The second point turns out slower than the third, which is better: it goes. Times are the medians."""
    budget = PlantedBudget()
    fit_front(budget)
    forget_front("planted")
    counts = budget.timed[: front.POINTS]
    assert budget.timed == counts * front.TURNS, "timed in turns"
    slow = PlantedBudget()
    slow.milliseconds = lambda choice, parameters, frames: (
        (1.0 + 0.01 * parameters.vpl_count) * (9.0 if parameters.vpl_count == counts[1] else 1.0)
    )
    points = fit_front(slow)
    assert counts[1] not in [point.frame.vpl_count for point in points]
    assert len(points) == front.POINTS - 1
    assert_monotone(points)


def test_an_interrupted_front_goes_on_where_it_was(tmp_path):
    whole = fit_front(PlantedBudget())
    forget_front("planted")
    first = PlantedBudget(interrupted_at=2)
    with pytest.raises(KeyboardInterrupt):
        fit_front(first)
    assert len(kept_files(tmp_path)) == 1
    shares = []
    second = PlantedBudget()
    second.costs = second.costs.scaled(1.5)  # the machine is busier now: the budgets are those begun with
    points = fit_front(second, shares.append)
    assert len(second.fitted) == front.POINTS - 2
    assert [*first.fitted, *second.fitted] == [point.budget for point in whole]
    for point, same in zip(points, whole, strict=True):
        assert (point.frame, point.parameters, point.relmse) == (same.frame, same.parameters, same.relmse)
        assert (point.descent.loss, point.descent.status) == (same.descent.loss, same.descent.status)
        assert (point.frame_size, point.machine) == (same.frame_size, same.machine)
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, pytest.approx(1.0 - 0.5 / front.POINTS))
    assert len(kept_files(tmp_path)) == 1, "until its files are written"
    forget_front("planted")
    assert kept_files(tmp_path) == [], "one that is written is measured anew"


@pytest.mark.parametrize(
    "damage", ["", "[]", '{"budgets": [1.0], "fits": [[{"budget": 1}]]}', '{"budgets": 3}']
)
def test_a_damaged_file_of_a_front_is_no_front(tmp_path, damage):
    path = tmp_path / "cache" / "fronts" / "planted.json"
    path.parent.mkdir(parents=True)
    path.write_text(damage)
    budget = PlantedBudget()
    assert len(fit_front(budget)) == len(budget.fitted) == front.POINTS


def test_budgets_that_are_not_met_are_left_out_unless_none_is():
    assert len(fit_front(PlantedBudget(refused=(0, 3)))) == front.POINTS - 2
    forget_front("planted")
    assert len(fit_front(PlantedBudget(refused=(front.POINTS - 1,)))) == front.POINTS - 1
    forget_front("planted")
    with pytest.raises(InputError, match="no frame could be measured"):
        fit_front(PlantedBudget(refused=range(front.POINTS)))


@pytest.fixture
def write_fit(tmp_path, monkeypatch):
    """Writes a fit with a front to the folder `out`; `metrics` is the text of metrics.json."""
    for name in ("write_views", "write_png", "write_view_images", "write_config"):
        monkeypatch.setattr(fit_scene, name, lambda *_: None)

    def write(points, metrics: str = "old") -> list[dict]:
        front_of = Front(points, START, (64, 48), "planted")
        result = object.__new__(FitResult)
        parts = {"views": (), "comparison": None, "evaluation": SimpleNamespace(views=()), "config": None}
        for name, value in {**parts, "document": {"scene": metrics}}.items():
            object.__setattr__(result, name, value)
        fit_scene._write(result, tmp_path / "out", front_of)
        return front_of.rows()

    return write


def test_a_front_changes_with_its_fit(tmp_path, write_fit, monkeypatch):
    """Where metrics.json cannot be written, the former front stays, and the new one's fits are kept."""
    points = fit_front(PlantedBudget())
    write_fit(points)
    fit_front(PlantedBudget())
    before = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
    assert {path.name for path in before} >= {"0.json", "pareto.csv", "pareto.png", "metrics.json"}

    def full(path, text):
        raise MachineError(f"{path}: cannot be written (No space left on device)")

    with monkeypatch.context() as patch:
        patch.setattr(fit_scene, "write_text_whole", full)
        with pytest.raises(MachineError, match=r"out/metrics\.json: cannot be written"):
            write_fit(points[:2])
    assert before == {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
    assert len(kept_files(tmp_path)) == 1
    write_fit(points[:2])
    assert kept_files(tmp_path) == []


def test_a_front_that_is_written_replaces_the_one_before(tmp_path, write_fit):
    """Configs, table and plot; none of a longer front that was there stays. A file of one's own does."""
    points = fit_front(PlantedBudget())
    write_fit(points)
    out = tmp_path / "out"
    (out / "pareto" / "0.notes.txt").write_text("mine")
    rows = write_fit(points[:2])
    assert (out / "pareto" / "0.notes.txt").read_text() == "mine"
    (out / "pareto" / "0.notes.txt").unlink()
    written = sorted(Path(out / "pareto").iterdir())
    assert [path.name for path in written] == ["0.json", "1.json"]
    for path, point, row in zip(written, points, rows, strict=False):
        config = read_config(path)
        assert config.parameters == point.parameters
        met = MetBudget(point.budget, (64, 48), "planted")
        assert config.quality == replace(point.frame.choice, budget=met)
        assert config.provenance["milliseconds"] == point.frame.milliseconds
        assert row["frame_size"] == [64, 48]
    head, *lines = (out / "pareto.csv").read_text().splitlines()
    assert head == "milliseconds,relmse,vpl_count,interleave,map_size,rsm_resolution,config"
    assert [line.split(",")[-1] for line in lines] == ["pareto/0.json", "pareto/1.json"]
    assert len({line.count(",") for line in (head, *lines)}) == 1
    assert (out / "pareto.png").read_bytes()[:4] == b"\x89PNG"
    assert len(budget_lines({"pareto": rows})) == 1
