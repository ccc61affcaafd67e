"""Saving, loading, and files that change while a window is open."""

import json
import os
from dataclasses import replace

import numpy as np
import pytest
from window_talk import Talk

import vpltune
from vpltune.renderer.config.tuned_config import write_config
from vpltune.renderer.scene.placement.scene_sidecar import read_sidecar


def test_what_is_saved_is_read_and_drawn_alike(talk, tmp_path, scene_file):
    talk.edit(gesture=1, parameter="intensity", value=3.0)
    talk.edit(gesture=2, quality="map_size", value=12)
    before = talk.shown().pixels
    path = tmp_path / "saved" / "mine.json"
    talk.say("save", what="config", path=str(path))
    assert not talk.message("state")["unsaved"]
    saved = vpltune.read_config(path)
    assert (saved.parameters.intensity, saved.quality.map_size) == (3.0, 12)
    assert saved.provenance["edited"] == "by hand in vpltune view"
    talk.edit(gesture=3, parameter="intensity", value=1.0)
    talk.say("load", path=str(path))
    while talk.message("state")["configs"]["hand"]["parameters"]["intensity"] != 3.0:
        pass
    assert np.array_equal(talk.shown().pixels, before)


def test_lights_are_saved_as_the_sidecar_that_the_next_window_reads(window, talk, scene_file, config_file):
    light = dict(talk.state["lights"][0], intensity=[1.0, 2.0, 3.0], range=2.5)
    assert talk.edit(gesture=1, light=0, value=light)["unsaved_lights"]
    talk.look()
    talk.say("save", what="sidecar", path=None)
    assert not talk.message("state")["unsaved_lights"]
    saved = read_sidecar(scene_file.with_suffix(".vpltune.toml"))
    camera, lights = saved.camera, saved.lights
    assert lights is not None and lights[0].intensity.tolist() == [1.0, 2.0, 3.0]
    assert lights[0].range == 2.5 and talk.state["lights"][0]["range"] == 2.5
    assert camera is not None
    assert np.allclose(camera.to_world.ravel(), talk.scene["camera"]["to_world"], atol=1e-6)


def test_kept_views_are_saved_for_fits(talk, tmp_path):
    talk.say("keep_view", name="close", camera=talk.scene["camera"])
    assert [view["name"] for view in talk.message("state")["views"]][-1] == "close"
    talk.look()
    talk.say("save", what="views", path=str(tmp_path / "views.json"))
    talk.message("notice")
    assert [view.name for view in vpltune.read_views(tmp_path / "views.json")] == ["page", "close"]


@pytest.mark.parametrize(
    ("members", "rule"),
    [
        ({"what": "config", "path": "/nowhere/at/all/x.json"}, "cannot be written"),
        ({"what": "config", "path": "x.png"}, "must end in .json"),
        ({"what": "sidecar", "path": "x.toml"}, "ends in .vpltune.toml"),
        ({"what": "all", "path": None}, "must be one of"),
        ({"what": "config", "path": 7}, "must be a path"),
    ],
)
def test_a_save_that_cannot_be_is_told_in_one_line(talk, members, rule):
    if members["path"] == "/nowhere/at/all/x.json" and os.geteuid() == 0:
        members = members | {"path": "/proc/x.json"}
    talk.look()
    talk.say("save", **members)
    notice = talk.message("notice")
    assert notice["level"] == "error" and rule in notice["text"] and "\n" not in notice["text"]


def test_a_config_that_changes_on_disk_is_read_again_and_a_broken_one_is_told(talk, config_file):
    good = vpltune.read_config(config_file)
    changed = replace(good, parameters=replace(good.parameters, intensity=5.0))
    write_config(config_file, changed)
    while talk.message("state")["configs"]["hand"]["parameters"]["intensity"] != 5.0:
        pass
    config_file.write_text("{ broken")
    notice = talk.message("notice")
    while notice["level"] != "error":
        notice = talk.message("notice")
    assert "the config stays as it was" in notice["text"] and str(config_file) in notice["text"]
    assert talk.state["configs"]["hand"]["parameters"]["intensity"] == 5.0


def test_a_scene_that_is_deleted_is_still_drawn(talk, scene_file):
    before = talk.shown().pixels
    scene_file.unlink()
    assert "has gone" in talk.message("notice")["text"]
    assert np.array_equal(talk.shown().pixels, before)


def test_a_scene_that_changes_is_read_again_and_a_broken_one_is_not(talk, scene_file):
    before = talk.shown().pixels
    whole = scene_file.read_bytes()
    scene_file.write_bytes(whole[:500])
    notice = talk.message("notice")
    while notice["level"] != "error":
        notice = talk.message("notice")
    assert "the scene stays as it was read before" in notice["text"]
    scene_file.write_bytes(whole)
    assert talk.message("scene")["name"] == talk.scene["name"]
    assert np.array_equal(talk.shown().pixels, before)


def test_kept_views_that_were_not_saved_come_back(own_cache, tmp_path, scene_file, config_file):
    with vpltune.view(scene_file, config_file) as window, Talk(window.address) as talk:
        talk.say("keep_view", name="close", camera=dict(talk.scene["camera"], yfov=0.5))
        assert talk.message("state")["unsaved_views"]
    with vpltune.view(scene_file, config_file) as window, Talk(window.address) as talk:
        (view,) = (view for view in talk.state["views"] if view["split"] == "kept")
        assert (view["name"], view["camera"]["yfov"]) == ("close", 0.5)
        assert talk.state["unsaved_views"] and not talk.state["unsaved"]
        talk.look()
        talk.say("save", what="views", path=str(tmp_path / "views.json"))
        assert not talk.message("state")["unsaved_views"]
    with vpltune.view(scene_file, config_file) as window, Talk(window.address) as talk:
        assert not talk.state["can_undo"]


def test_changes_that_were_not_saved_come_back(own_cache, scene_file, config_file):
    with vpltune.view(scene_file, config_file) as window, Talk(window.address) as talk:
        talk.edit(gesture=1, parameter="intensity", value=7.0)
    with vpltune.view(scene_file, config_file) as window, Talk(window.address) as talk:
        state = talk.state
        assert state["configs"]["hand"]["parameters"]["intensity"] == 7.0
        assert state["unsaved"] and state["undo_name"] == "unsaved changes of last time"
        talk.say("undo")
        assert talk.message("state")["configs"]["hand"]["parameters"]["intensity"] == 1.0
    assert json.loads(config_file.read_text())["parameters"]["intensity"] == 1.0
