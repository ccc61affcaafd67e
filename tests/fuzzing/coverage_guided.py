"""Fuzz one reader by the code that it passes through: `python -m tests.fuzzing.coverage_guided gltf`.

Atheris (https://github.com/google/atheris, not among the requirements) changes bytes so that new lines of the
reader are reached. The bytes are the random numbers of the writers of cases, so that what it makes is nearly
a file of the reader's format, however it is changed. It ends at the first finding, and leaves its input
behind.
"""

import argparse
import random
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["vpltune.renderer"], enable_loader_override=False):
    from tests.fuzzing.cases import READERS
from tests.fuzzing.outcomes import judged

RSS_LIMIT_MB = 2048
"""A choice: what a reader may take, twice, as Atheris itself has a share."""
SECONDS_OF_A_CASE = 20
"""On the clock, ten times what a case may take of the processor: instrumented code is slow. A choice."""
LONGEST = 4096
"""Bytes of an input. A choice: writers draw some hundreds of numbers."""


class DrawnFromBytes(random.Random):
    """Random numbers that are given bytes, and, when these are used up, those of a seed."""

    def __init__(self, content: bytes):
        super().__init__(len(content))
        self._content = content
        self._at = 0

    def random(self) -> float:
        """In [0, 1), with 53 bits."""
        return self.getrandbits(53) / (1 << 53)

    def getrandbits(self, count: int, /) -> int:
        """So many bits."""
        size = (count + 7) // 8
        taken = self._content[self._at : self._at + size]
        self._at += size
        if len(taken) < size:
            return super().getrandbits(count)
        return int.from_bytes(taken, "little") & ((1 << count) - 1)


def main() -> None:
    """Fuzz a reader for some minutes; the inputs that reached new code are kept and taken up again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("reader", choices=READERS)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--inputs", type=Path, default=Path("out/fuzzing"), help="kept inputs, by reader")
    chosen = parser.parse_args()
    reader = READERS[chosen.reader]
    kept = chosen.inputs / chosen.reader
    kept.mkdir(parents=True, exist_ok=True)

    def one_input(content: bytes) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = reader.write(Path(folder), DrawnFromBytes(content), True)
            outcome = judged(reader.read, path, mutated=True)
        if outcome.verdict == "finding":
            raise AssertionError(f"{outcome.kind}: {outcome.message}")

    options = (
        f"-max_total_time={round(60 * chosen.minutes)}",
        f"-rss_limit_mb={RSS_LIMIT_MB}",
        f"-timeout={SECONDS_OF_A_CASE}",
        f"-max_len={LONGEST}",
        f"-artifact_prefix={kept}-",
    )
    atheris.Setup([sys.argv[0], *options, str(kept)], one_input)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
