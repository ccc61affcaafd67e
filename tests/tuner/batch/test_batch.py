"""A batch resumes by default, fits duplicate scenes once, and writes a log that pandas reads."""

import json
import shutil
import sys
from dataclasses import replace

import pandas
import pytest

from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, config_text
from vpltune.renderer.errors import InputError
from vpltune.renderer.files.unfinished_files import PREFIX
from vpltune.tuner.batch.batch import run_batch
from vpltune.tuner.batch.batch_log import BatchLog
from vpltune.tuner.batch.job import JobOptions
from vpltune.tuner.batch.record import Records, as_document
from vpltune.tuner.batch.tune_one import set_aside, tune_one

OPTIONS = JobOptions(start=config_text(TunedConfig()))


class Watcher:
    def __init__(self):
        self.order = []

    def found(self, jobs, already_done):
        self.counts = (len(jobs), already_done)

    def happened(self, event):
        if event["event"] == "record":
            self.order.append(event["name"])


def one_after_another(jobs):
    for job in jobs:
        yield {"event": "stage", "key": job.key, "name": job.name, "stage": "fit", "share": 0.5}
        yield {"event": "record", **as_document(tune_one(job))}


@pytest.fixture
def library(tmp_path):
    folder = tmp_path / "library"
    folder.mkdir()
    for index, name in enumerate(("small", "larger", "largest")):
        (folder / f"{name}.glb").write_bytes(b"x" * (index + 1))
    return folder


def run(library, watcher=None, scheduler=one_after_another, options=OPTIONS, **arguments):
    watcher = watcher or Watcher()
    result = run_batch(library, library.parent / "out", options, scheduler, watcher, **arguments)
    return result, watcher


def test_the_largest_is_first_and_a_second_run_does_nothing(library, fits):
    result, watcher = run(library)
    assert watcher.order == ["largest.glb", "larger.glb", "small.glb"]
    assert (result.count("done"), result.fitted) == (3, 3)
    again, watcher = run(library)
    assert (again.records, again.fitted, watcher.counts) == (result.records, 0, (0, 3))
    assert len(fits.scenes) == 3


def test_a_changed_scene_is_done_again_and_the_listing_says_which_record_counts(library, fits):
    run(library)
    (library / "small.glb").write_bytes(b"!")
    result, _ = run(library)
    assert (result.fitted, len(result.records)) == (1, 3)
    out = library.parent / "out"
    assert len(Records(out).known_keys()) == 4
    listing = json.loads((out / "library.json").read_text())["scenes"]
    assert {record.key for record in result.records} == set(listing.values())


def test_fits_start_with_the_quality_of_the_config_and_another_is_done_again(library, fits):
    first = TunedConfig(quality=Quality(interleave=4, map_size=8, rsm_resolution=256))
    second = replace(first, quality=replace(first.quality, map_size=16))
    for start in (first, second):
        options = JobOptions(start=config_text(start))
        assert run(library, options=options)[0].fitted == 3
        assert fits.starts[-3:] == [start] * 3
        assert run(library, options=options)[0].fitted == 0


def test_copies_are_done_once(library, fits):
    shutil.copy(library / "small.glb", library / "twin.glb")
    result, _ = run(library)
    assert result.copies == {"twin.glb": "small.glb"}
    assert len(fits.scenes) == 3


def test_an_interrupted_run_goes_on_where_it_was(library, fits):
    def interrupted(jobs):
        for index, event in enumerate(one_after_another(jobs)):
            if index == 2:
                raise KeyboardInterrupt
            yield event

    with pytest.raises(KeyboardInterrupt):
        run(library, scheduler=interrupted)
    result, watcher = run(library)
    assert watcher.counts == (2, 1)
    assert result.count("done") == 3
    assert len(fits.scenes) == 3


def test_failed_scenes_are_left_alone_until_asked_for(library, fits):
    def fails(jobs):
        for job in jobs:
            yield {"event": "record", **as_document(set_aside(job, "too slow", 4, 1.0))}

    assert run(library, scheduler=fails)[0].count("failed") == 3
    assert run(library)[0].fitted == 0
    assert run(library, retry_failed=True)[0].count("done") == 3


def test_what_killed_processes_left_is_swept_and_records_are_not(library, fits):
    out = library.parent / "out"
    first, _ = run(library)
    (out / ".mine.json").write_text("{}")
    kept = sorted(path for path in out.rglob("*") if path.is_file())
    key = "0" * 64
    leftovers = [
        out / "records" / f"{PREFIX}ab12.json",
        out / f"scenes/gone-{key[:12]}" / "tuned.json",
        out / "claims" / key[:12],
        out / f"{PREFIX}x.json",
    ]
    for path in leftovers:
        path.parent.mkdir(exist_ok=True)
        path.write_text("{")
    assert run(library)[0].records == first.records
    assert not [path for path in leftovers if path.exists()]
    assert not (out / f"scenes/gone-{key[:12]}").exists()
    assert [path for path in kept if not path.exists()] == []


def test_pandas_reads_the_log(library, fits):
    run(library)
    with (library.parent / "out" / "log.jsonl").open("a") as file:
        file.write('{"event": "record", "na')  # as if a run had been killed in the middle of a line
    (library / "small.glb").write_bytes(b"!")
    run(library)
    log = pandas.read_json(library.parent / "out" / "log.jsonl", lines=True)
    assert list(log["event"]) == [
        "run_started",
        *["record"] * 3,
        "run_finished",
        "run_started",
        "record",
        "run_finished",
    ]
    records = log[log["event"] == "record"]
    assert set(records["status"]) == {"done"}
    assert pandas.to_datetime(log["time"]).is_monotonic_increasing


def test_lines_of_two_logs_do_not_mix(tmp_path):
    with BatchLog(tmp_path / "log") as one, BatchLog(tmp_path / "log") as two:
        for index in range(50):
            (one, two)[index % 2].write({"index": index, "nan": float("nan")})
    lines = [json.loads(line) for line in (tmp_path / "log").read_text().splitlines()]
    assert [line["index"] for line in lines] == list(range(50))
    assert lines[0]["nan"] is None


def test_an_output_that_is_a_file_is_refused(library, fits):
    (library.parent / "out").write_text("")
    with pytest.raises(InputError, match="must be a folder, and is a file"):
        run(library)


def test_tensorboard_shows_losses_and_errors(library, fits):
    fits.files["metrics.json"] = json.dumps(
        {
            "loss": {"curve": [2.0, 1.0, None]},
            "metrics": {"fitted": {"default": {"relmse": 0.4}, "tuned": {"relmse": 0.2}}, "held_out": {}},
        }
    )
    run(library, tensorboard=True)
    (events,) = (library.parent / "out" / "tensorboard").rglob("events.out.*")
    content = events.read_bytes()
    assert b"loss/largest.glb" in content
    assert b"relmse_fitted/small.glb" in content


def test_tensorboard_that_is_not_installed_is_said_before_anything_is_fitted(library, fits, monkeypatch):
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    with pytest.raises(ModuleNotFoundError, match="tensorboardX"):
        run(library, tensorboard=True)
    assert not fits.scenes
