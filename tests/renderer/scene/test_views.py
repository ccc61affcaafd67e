"""views.json: what is read back, and what is refused with one line."""

import json
import math

import pytest

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.views import light_to_json, read_views, write_views

VIEW = {
    "name": "a",
    "split": "fitted",
    "size": [8, 6],
    "camera": {"to_world": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 3, 0, 0, 0, 1], "yfov": 0.8},
    "lights": [
        {
            "type": "spot",
            "intensity": [1, 1, 1],
            "position": [0, 2, 0],
            "direction": [0, -1, 0],
            "inner_cone": 0.5,
            "outer_cone": 0.5,
        }
    ],
}


def written(folder, text):
    path = folder / "views.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def ranged(value):
    return json.dumps({"views": [{**VIEW, "lights": [VIEW["lights"][0] | {"range": value}]}]})


def test_a_range_comes_back_and_is_not_written_without_one(tmp_path):
    """The text without a range is that of before: hashes of it are the keys of cached references."""
    (view,) = read_views(written(tmp_path, ranged(2.5)))
    assert view.lights[0].range == 2.5
    write_views(tmp_path / "again.json", "scene.glb", (view,))
    assert read_views(tmp_path / "again.json")[0].lights[0].range == 2.5
    (plain,) = read_views(written(tmp_path, json.dumps({"views": [VIEW]})))
    keys = ["type", "position", "direction", "intensity", "inner_cone", "outer_cone"]
    assert list(light_to_json(plain.lights[0])) == keys
    assert plain.lights[0].range == math.inf


def test_a_byte_order_mark_and_a_hard_edge_are_read(tmp_path):
    (view,) = read_views(written(tmp_path, b"\xef\xbb\xbf" + json.dumps({"views": [VIEW]}).encode()))
    light = view.lights[0]
    assert light.outer_cone == 0.5
    assert 0.0 < 0.5 - light.inner_cone < 0.001
    assert math.isclose(view.camera.yfov, 0.8)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ranged(0), r"views\[0\]\.lights\[0\]\.range: must be positive, at least 1e-30, got 0"),
        (ranged(-3), r"lights\[0\]\.range: must be positive"),
        (ranged("far"), r"lights\[0\]\.range: must be 1 finite number, got 'far'"),
        (ranged([3]), r"lights\[0\]\.range: must be 1 finite number, got \[3\]"),
        (
            json.dumps({"views": [VIEW]}).replace("0.8", "[0.8]"),
            r"yfov: must be 1 finite number, got \[0\.8\]",
        ),
        (ranged(None), r"lights\[0\]\.range: must be 1 finite number"),
        ("[" * 100_000, "nested too deep"),
        (json.dumps({"views": [VIEW]}).replace("[8, 6]", "[" * 900 + "]" * 900), "size: must be|nested too"),
        ("{", "not JSON"),
        (b"\xff\xfe\x00", "not UTF-8 text"),
        ('{"views": ' + "1" * 5000 + "}", "not JSON"),
        (json.dumps({"views": [VIEW]}).replace("[8, 6]", "[" + "9" * 4000 + ", 6]"), "size: must be"),
        (json.dumps({"views": [VIEW]}).replace("0.8", "1e999"), "yfov: must be 1 finite number"),
        (json.dumps({"views": [{**VIEW, "camera": []}]}), "must be an object, got list"),
        (
            json.dumps({"views": [VIEW]}).replace("[1, 1, 1]", "[1, 1e31, 1]"),
            r"intensity: .*at most 1e\+30 each",
        ),
        (json.dumps({"views": []}), "key 'views' must be a list of at least one view"),
        (" " * ((1 << 24) + 1), "must have at most 16,777,216 bytes"),
    ],
)
def test_broken_files_are_refused_with_one_line(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as refused:
        read_views(path)
    assert str(refused.value).startswith(str(path)) and "\n" not in str(refused.value)
