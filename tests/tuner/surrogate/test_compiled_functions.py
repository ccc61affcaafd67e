"""The cache of compiled functions: entries that a killed process left half-written are deleted."""

import zlib

from vpltune.tuner.surrogate.compiled_functions import drop_torn_entries


def test_torn_entries_go_and_whole_ones_stay(tmp_path):
    whole = zlib.compress(bytes(range(256)) * 40)
    contents = {
        "whole-cache": whole,
        "torn-cache": whole[:-5],
        "flipped-cache": whole[:30] + bytes([whole[30] ^ 1]) + whole[31:],
        "empty-cache": b"",
        "zstandard-cache": b"\x28\xb5\x2f\xfd and so on",
        "another": b"",
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    drop_torn_entries(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"whole-cache", "zstandard-cache", "another"}
