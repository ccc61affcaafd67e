"""How long batches of 1,000 and 100,000 scenes take on 10 and 1,000 workers: a simulated queue.

The simulation assumes:

- A scene takes the seconds of one of `MEASURED`, plus the seconds of rendering its references, which are
  log-uniform between the cheapest and the most expensive scene tried. Differences between machines multiply
  both by e^N(0, 0.25).
- 2 % of the scenes are rejected, 0.3 % crash halfway through every attempt, and 0.1 % hang until they are
  stopped.
- A worker first loads and compiles for `STARTUP_S`, and the head node hashes scenes on `HEAD_CORES` cores.

The benchmark measures the head node's own work: hashing, listing and reading records, and the bookkeeping for
each scene that ends.
"""

import hashlib
import heapq
import json
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from benchmarks.harness.row import Row
from vpltune.cli.options import SCENE_SECONDS
from vpltune.tuner.batch.attempts import MOST_PASSED
from vpltune.tuner.batch.batch_log import BatchLog
from vpltune.tuner.batch.record import Record, Records

MEASURED = (
    (16643813, 49.0),
    (10212, 19.2),
    (1506204, 29.1),
    (7712, 24.0),
    (1653274, 32.5),
    (2727728, 34.3),
    (183256, 16.0),
    (3516596, 35.2),
    (15862, 14.5),
    (770134, 22.7),
    (1794452, 42.4),
    (825860, 27.4),
    (2562744, 40.0),
)
"""Bytes of a real scene with all files it refers to, and seconds that `vpltune batch` took for it on one core
of a shared two-core machine, with its references cached."""
REFERENCE_S = (12.8, 133.7)
"""Seconds to render three references on one such core: of a Cornell box, and of a closed level of a game."""
STARTUP_S = 8.0
"""Seconds until a worker begins its first scene. An assumption."""
HEAD_CORES = 16
"""Cores of the head node. An assumption."""
ATTEMPTS = 4
"""Attempts at a scene that crashes. An assumption."""
REFUSED, CRASHING, HANGING = 0.02, 0.003, 0.001
"""Shares of scenes that are rejected, that crash and that hang. Assumptions."""
REFUSED_S = 0.2
"""Seconds until a scene is rejected. An assumption."""
SCATTER = 0.25
"""Standard deviation of the logarithm of a machine's speed. An assumption."""
SIZES = ((1_000, 10), (1_000, 1_000), (100_000, 10), (100_000, 1_000))
"""Scenes and workers of each simulated batch. A choice."""
RECORDS = 5_000
"""Records in the folder that the head's work is timed on. A choice."""
FORMER_SCENE_SECONDS = 3600.0
"""An earlier time limit of a scene, kept for comparison."""
LISTING_LIMIT_S = 2.0
"""Seconds to list 100,000 records. A choice."""
HEAD_LIMIT_MS = 6.0
"""Milliseconds of the head for each scene. With 1,000 workers, that is a new scene for each of them every six
seconds, and real scenes take longer."""


@dataclass(frozen=True)
class Head:
    """Seconds of the head node's work, which it does one step after another."""

    per_byte: float
    """Hashing on one core."""
    per_ended_scene: float
    """Reading the scene's record and writing a line to the log."""
    per_known_record: float
    """Listing the folder of records."""
    per_read_record: float
    """Reading a record for the summary at the end."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Hours from the command to its summary, against all work divided evenly among the workers.

    The last rows tell what each scheduling rule is worth: the hours of the largest batch without it.
    """
    head = measured_head()
    made = [
        Row(
            "simulated_look_through_100000_records_s",
            100_000 * head.per_known_record,
            "s",
            "limit",
            LISTING_LIMIT_S,
        ),
        Row(
            "simulated_head_per_scene_ms",
            1e3 * head.per_ended_scene,
            "ms",
            "limit for 1,000 workers",
            HEAD_LIMIT_MS,
        ),
    ]
    for index, (scenes, workers) in enumerate(SIZES):
        progress("simulation", index / len(SIZES))
        library = drawn_library(scenes, np.random.default_rng(scenes))
        hours, ideal = batch_hours(library, workers, head), library.seconds().sum() / workers / 3600.0
        made.append(
            Row(f"simulated_{scenes}_scenes_{workers}_workers_h", hours, "h", "work ÷ workers", ideal)
        )
    rules = {
        "listed_order": {"largest_first": False},
        "hangs_tried_4_times_for_an_hour": {"hang_seconds": ATTEMPTS * FORMER_SCENE_SECONDS},
        "hashing_on_one_core": {"head_cores": 1},
        "shares_dealt_and_kept": {"dealt": True},
    }
    for name, changes in rules.items():
        other = batch_hours(library, workers, head, **changes)
        made.append(Row(f"simulated_{name}_h", other, "h", f"{scenes} on {workers}", hours))
    progress("simulation", 1.0)
    return made


@dataclass(frozen=True)
class DrawnLibrary:
    """A random library: an array of each property of its scenes."""

    bytes: Float64[np.ndarray, " scenes"]
    plain_seconds: Float64[np.ndarray, " scenes"]
    """Seconds of all attempts together, for scenes that do not hang."""
    hanging: Float64[np.ndarray, " scenes"]
    """1 where a scene hangs, else 0."""

    def seconds(self, hang_seconds: float = MOST_PASSED * SCENE_SECONDS) -> Float64[np.ndarray, " scenes"]:
        """Seconds that a worker spends on each scene."""
        return np.where(self.hanging > 0.0, hang_seconds, self.plain_seconds)


def drawn_library(scenes: int, random: np.random.Generator) -> DrawnLibrary:
    """Draw `scenes` scenes like the measured ones; some of them are rejected, crash or hang."""
    measured = np.array(MEASURED, np.float64)[random.integers(0, len(MEASURED), scenes)]
    low, high = np.log(REFERENCE_S)
    references = np.exp(random.uniform(low, high, scenes))
    seconds = (measured[:, 1] + references) * np.exp(random.normal(0.0, SCATTER, scenes))
    fate = random.uniform(0.0, 1.0, scenes)
    crashing = (fate >= REFUSED) & (fate < REFUSED + CRASHING)
    # Each of the attempts gets halfway and costs a new process.
    seconds = np.where(crashing, ATTEMPTS * (0.5 * seconds + STARTUP_S), seconds)
    seconds = np.where(fate < REFUSED, REFUSED_S, seconds)
    hanging = (fate >= 1.0 - HANGING).astype(np.float64)
    return DrawnLibrary(measured[:, 0], seconds, hanging)


def batch_hours(
    library: DrawnLibrary,
    workers: int,
    head: Head,
    *,
    largest_first: bool = True,
    hang_seconds: float = MOST_PASSED * SCENE_SECONDS,
    head_cores: int = HEAD_CORES,
    dealt: bool = False,
) -> float:
    """Hours from the command to its summary: hashing, the queue, and reading all records at the end.

    The head processes ended scenes one after another, and a worker gets its next scene only after that.

    Args:
        largest_first: whether large scenes are started first; else in the order of the list.
        hang_seconds: seconds that a hanging scene occupies its worker.
        head_cores: cores that hash.
        dealt: whether each worker gets a fixed share of the scenes at the start.
    """
    seconds = library.seconds(hang_seconds)
    if largest_first:
        seconds = seconds[np.argsort(-library.bytes, kind="stable")]
    count = len(seconds)
    before = library.bytes.sum() * head.per_byte / head_cores + count * head.per_known_record
    if dealt:
        shares = [seconds[first::workers].sum() for first in range(workers)]
        end = STARTUP_S + max(shares)
    else:
        end = _queue_seconds(seconds, workers, head.per_ended_scene)
    return (before + end + count * head.per_read_record) / 3600.0


def _queue_seconds(seconds: Float64[np.ndarray, " scenes"], workers: int, per_ended_scene: float) -> float:
    """Seconds until the head has processed the last scene, if a free worker takes the next of the queue."""
    waiting = iter(seconds.tolist())
    running = [STARTUP_S + cost for _, cost in zip(range(workers), waiting, strict=False)]
    heapq.heapify(running)
    head_free = 0.0
    while running:
        ended = running[0]
        head_free = max(head_free, ended) + per_ended_scene
        cost = next(waiting, None)
        if cost is None:
            heapq.heappop(running)
        else:
            heapq.heapreplace(running, head_free + cost)
    return head_free


def measured_head() -> Head:
    """Time this machine's work as a head node, on a folder of `RECORDS` records."""
    block = bytes(1 << 26)
    started = time.perf_counter()
    hashlib.sha256(block)
    per_byte = (time.perf_counter() - started) / len(block)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        records = Records(folder)
        keys = _write_records(records, folder)
        started = time.perf_counter()
        assert len(records.known_keys()) == RECORDS
        per_known_record = (time.perf_counter() - started) / RECORDS
        sample = keys[::5]
        started = time.perf_counter()
        found = [records.read(key) for key in sample]
        per_read_record = (time.perf_counter() - started) / len(sample)
        with BatchLog(folder / "log.jsonl") as log:
            started = time.perf_counter()
            for record in found:
                assert record is not None, "all records of the sample were written"
                log.write({"event": "record", **asdict(record)})
            per_line = (time.perf_counter() - started) / len(sample)
    return Head(per_byte, per_read_record + per_line, per_known_record, per_read_record)


def _write_records(records: Records, folder: Path) -> list[str]:
    (folder / "records").mkdir()
    keys = [hashlib.sha256(str(index).encode()).hexdigest() for index in range(RECORDS)]
    stages = {"load": 1.0, "reference": 2.0, "capture": 0.5, "fit": 0.5, "evaluate": 2.0, "total": 6.0}
    for index, key in enumerate(keys):
        record = Record(
            key, f"/library/scene{index}.glb", f"scene{index}.glb", "done", "the loss has settled",
            6.0, 1, f"scenes/scene{index}-{key[:12]}", "node", "2026-01-01T00:00:00.000+00:00", 0, stages,
        )  # fmt: skip
        # As `Records.write`, but without waiting for the disk.
        records.path(key).write_text(json.dumps(asdict(record)))
    return keys
