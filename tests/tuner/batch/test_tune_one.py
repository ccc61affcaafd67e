"""A scene is tuned once: the record decides, the claim excludes others, partial output is replaced."""

import json
from pathlib import Path

import pytest

from vpltune.renderer.errors import InputError, MachineError
from vpltune.tuner.batch.claim import claimed
from vpltune.tuner.batch.job import Job, read_jobs, write_jobs
from vpltune.tuner.batch.record import Records
from vpltune.tuner.batch.tune_one import set_aside, tune_one


def records_of(job: Job) -> Records:
    return Records(Path(job.folder))


def test_a_scene_is_fitted_once(make_job, fits):
    job = make_job()
    record = tune_one(job)
    assert (record.status, record.attempts, record.reason) == ("done", 1, "settled")
    assert (Path(job.folder) / record.output / "tuned.json").exists()
    assert record.stages == {"fit": 1.0, "total": 2.0}
    assert tune_one(job) == record
    assert fits.scenes == ["room.glb"]
    assert not list((Path(job.folder) / "claims").iterdir())


def test_a_claimed_scene_is_left_to_its_holder(make_job, fits):
    job = make_job()
    with claimed(job.claim):
        assert tune_one(job) is None
        assert set_aside(job, "slow", 4, 1.0) is None
    assert not fits.scenes
    assert not records_of(job).known_keys()


def test_what_a_killed_process_left_is_made_anew(make_job, fits):
    job = make_job()
    job.output.mkdir(parents=True)
    (job.output / "half.json").write_text("{")
    tune_one(job)
    assert [path.name for path in job.output.iterdir()] == ["tuned.json"]


@pytest.mark.parametrize("content", ["", "{", "[]", '{"key": "a"}'])
def test_a_damaged_record_is_none(make_job, fits, content):
    job = make_job()
    path = records_of(job).path(job.key)
    path.parent.mkdir(parents=True)
    path.write_text(content)
    assert tune_one(job).status == "done"
    assert json.loads(path.read_text())["key"] == job.key


def test_a_byte_order_mark_before_a_record_is_passed_over(make_job, fits):
    job = make_job()
    record = tune_one(job)
    path = records_of(job).path(job.key)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert records_of(job).read(job.key) == record


def test_a_scene_that_cannot_be_read_is_refused_with_its_reason(make_job, fits):
    job = make_job()
    fits.error = InputError(f"{job.scene}: no triangles\nat all")
    record = tune_one(job)
    assert (record.status, record.output) == ("refused", "")
    assert record.reason == f"{job.scene}: no triangles at all"


def test_a_folder_that_cannot_be_written_to_is_not_the_scenes_fault(make_job, fits):
    job = make_job()
    fits.error = InputError(f"{job.output}/tuned.json: cannot be written (No space left on device)")
    with pytest.raises(InputError, match="cannot be written"):
        tune_one(job)
    assert not records_of(job).known_keys()


@pytest.mark.parametrize("error", [MachineError("no OpenGL"), ValueError("a defect"), MemoryError()])
def test_an_attempt_that_fails_leaves_no_record_and_no_claim(make_job, fits, error):
    job = make_job()
    fits.error = error
    with pytest.raises(type(error)):
        tune_one(job)
    assert not records_of(job).known_keys()
    assert not job.claim.exists()


@pytest.mark.parametrize(
    ("outcome", "status"),
    [("improved", "done"), ("kept", "done"), ("doubtful", "done"), ("unlit", "unlit")],
)
def test_a_record_says_how_the_fit_ended(make_job, fits, outcome, status):
    job = make_job()
    fits.status = outcome
    record = tune_one(job)
    assert (record.status, record.fit, record.output) == (status, outcome, job.output_name)


def test_set_aside_keeps_the_reason_and_yields_to_a_record(make_job, fits):
    job = make_job()
    job.output.mkdir(parents=True)
    record = set_aside(job, "it took too long", 4, 60.0)
    assert (record.status, record.attempts, record.reason) == ("failed", 4, "it took too long")
    assert not job.output.exists()
    assert tune_one(job) == record
    other = make_job("other.glb")
    done = tune_one(other)
    assert set_aside(other, "late", 4, 60.0) == done


def test_a_job_travels_as_text(make_job):
    job = make_job("name with spaces/and é.glb".replace("/", "-"))
    assert Job.from_json(job.to_json()) == job
    assert job.output_name == f"scenes/name_with_spaces-and_.glb-{job.key[:12]}".replace(".glb-", "-")


def test_many_jobs_travel_in_a_file(make_job, tmp_path):
    jobs = [make_job(f"{index}.glb", size=index) for index in range(3)]
    write_jobs(tmp_path / "jobs.json", jobs)
    assert read_jobs(tmp_path / "jobs.json") == jobs
