"""One process at a time holds a claim; it lapses when the process dies or its host sends no heartbeat."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time

from vpltune.tuner.batch.claim import STALE_SECONDS, claimed

HOLDER = """
import sys, time
from pathlib import Path
from vpltune.tuner.batch.claim import claimed
with claimed(Path(sys.argv[1])) as mine:
    print(mine, flush=True)
    sys.stdin.read()
"""


@contextlib.contextmanager
def another_process_holds(path):
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert holder.stdout.readline() == "True\n"
        yield holder
    finally:
        holder.kill()
        holder.wait()
        holder.stdin.close()
        holder.stdout.close()


def test_a_claim_is_held_by_one_and_leaves_nothing(tmp_path):
    path = tmp_path / "claims" / "a"
    with claimed(path) as first:
        assert first
        with claimed(path) as second:
            assert not second
        assert path.exists()
    assert not path.exists()
    with claimed(path) as again:
        assert again


def test_a_claim_of_a_living_process_is_respected_and_of_a_killed_one_taken_over(tmp_path):
    path = tmp_path / "a"
    with another_process_holds(path) as holder:
        with claimed(path) as mine:
            assert not mine
        holder.send_signal(signal.SIGKILL)
        holder.wait()
        assert path.exists()
        with claimed(path) as mine:
            assert mine
    assert not path.exists()


def test_a_claim_of_another_machine_counts_while_its_heart_beats(tmp_path):
    path = tmp_path / "a"
    path.write_text(json.dumps({"host": "another", "pid": 1}))
    with claimed(path) as mine:
        assert not mine
    long_ago = time.time() - STALE_SECONDS - 1.0
    os.utime(path, (long_ago, long_ago))
    with claimed(path) as mine:
        assert mine


def test_a_claim_that_was_torn_while_it_was_written_is_free(tmp_path):
    (tmp_path / "a").write_text('{"ho')
    with claimed(tmp_path / "a") as mine:
        assert mine


COUNTER = """
import sys, time
from pathlib import Path
from vpltune.tuner.batch.claim import claimed
folder, done = Path(sys.argv[1]), 0
while done < 15:
    with claimed(folder / "claim") as mine:
        if mine:
            (folder / "count").write_text(str(int((folder / "count").read_text()) + 1))
            done += 1
    time.sleep(0.001)
"""


def test_eight_processes_lose_no_count(tmp_path):
    """Each process increments the count under the claim. Two holders at once would lose an increment."""
    (tmp_path / "count").write_text("0")
    crew = [subprocess.Popen([sys.executable, "-c", COUNTER, str(tmp_path)]) for _ in range(8)]
    assert [process.wait() for process in crew] == [0] * 8
    assert (tmp_path / "count").read_text() == "120"
    assert [path.name for path in tmp_path.iterdir()] == ["count"]
