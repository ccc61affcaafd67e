"""Files that are no config: not there, not text, endless, or with a byte order mark."""

from pathlib import Path

import pytest

from vpltune.renderer.config.tuned_config import (
    MAXIMUM_FILE_BYTES,
    TunedConfig,
    config_text,
    read_config,
)
from vpltune.renderer.errors import InputError


def test_files_that_are_not_text_or_not_there(tmp_path):
    with pytest.raises(InputError, match=r"absent.json: cannot be read \(No such file"):
        read_config(tmp_path / "absent.json")
    with pytest.raises(InputError, match=r"cannot be read \(Is a directory"):
        read_config(tmp_path)
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not UTF-8 text"):
        read_config(tmp_path / "binary.json")
    (tmp_path / "long.json").write_bytes(b" " * (MAXIMUM_FILE_BYTES + 1))
    with pytest.raises(InputError, match="must have at most 1,048,576 bytes, has more"):
        read_config(tmp_path / "long.json")


def test_a_device_without_end_is_refused():
    with pytest.raises(InputError, match="must have at most 1,048,576 bytes, has more"):
        read_config(Path("/dev/zero"))


def test_a_byte_order_mark_is_passed_over(tmp_path):
    (tmp_path / "bom.json").write_bytes(b"\xef\xbb\xbf" + config_text(TunedConfig()).encode())
    assert read_config(tmp_path / "bom.json") == TunedConfig()
