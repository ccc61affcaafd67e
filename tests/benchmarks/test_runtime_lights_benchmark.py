"""The benchmark of the light pre-pass runs, and says what its figures are measured against."""

from benchmarks.speed import runtime_lights


def test_rows_of_a_small_run(monkeypatch):
    """Each count has a row beside one draw per light, and Python's part of a frame is above nothing."""
    monkeypatch.setattr(runtime_lights, "SIZE", (48, 32))
    monkeypatch.setattr(runtime_lights, "COUNTS", (20, 40))
    monkeypatch.setattr(runtime_lights, "PER_DRAW_LIGHTS", 20)
    monkeypatch.setattr(runtime_lights, "PYTHON_BATCHES", 1)
    stages = []
    few, more, python = runtime_lights.light_rows(lambda name, share: stages.append(share))
    assert [few.name, more.name, python.name] == ["lights_20", "lights_40", "python_per_frame"]
    assert few.against.startswith("one draw per light, measured (")
    assert more.against.startswith("one draw per light, extrapolated from 20 (")
    assert more.against_value == 2.0 * few.against_value
    assert all(row.unit == "ms" and row.value > 0.0 for row in (few, more, python))
    assert stages == sorted(stages)
    assert stages[-1] < 1.0
