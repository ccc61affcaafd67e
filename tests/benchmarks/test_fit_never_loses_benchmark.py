"""`bench fit_never_loses`: its rows from made-up results, and that its scenes chose nothing."""

import pytest

from benchmarks.tuning.fit_never_loses import FIGURES, SEED, Cell, cells, mode_rows, result_of, table


def result(name, status, ratio, mode="default"):
    document = {
        "status": status,
        "sentence": "",
        "notes": [],
        "seconds": {},
        "metrics": {
            "held_out": {
                "default": dict.fromkeys(FIGURES, 0.1),
                "tuned": {figure: 0.1 * ratio for figure in FIGURES},
                "ceiling": {},
            }
        },
    }
    return result_of(Cell(name, "", mode), document)


def test_rows_are_of_one_mode_and_of_lit_scenes():
    unlit = result("dark", "unlit", 1.0) | {"ratios": {}}
    results = [
        result("a", "improved", 0.5),
        result("b", "kept", 1.0),
        result("c", "improved", 1.2),
        result("d", "improved", 9.0, "few"),
        unlit,
    ]
    rows = {row.name: row for row in mode_rows("default", results)}
    assert rows["default.worst_relmse"].value == pytest.approx(1.2, rel=1e-3)
    assert rows["default.median_trimmed_relmse"].value == pytest.approx(1.0)
    assert rows["default.share_within_2_percent"].value == pytest.approx(2 / 3)
    assert rows["default.kept_share"].value == pytest.approx(1 / 3)
    assert "| dark | 512 | unlit | – |" in table(results)


def test_every_scene_is_fitted_in_both_modes_and_the_seed_is_not_that_of_the_prior():
    wanted = cells()
    assert sorted({cell.mode for cell in wanted}) == ["default", "few"]
    assert len({cell.file for cell in wanted}) == len(wanted)
    assert sum(isinstance(cell.scene, int) for cell in wanted) == 64
    # The rule of docs/chosen_on.md.
    assert SEED % 3 == 2
