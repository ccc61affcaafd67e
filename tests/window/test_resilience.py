"""Whatever a page, a process or a stranger does, the window goes on and says so in one line."""

import json
import os
import random
import signal
import urllib.error
import urllib.request

import psutil
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import vpltune
from vpltune.renderer.errors import InputError, MachineError
from vpltune.window.admission import Admission

GROWTH = 64 << 20
"""Bytes that the server may grow by during the messages: an image leaked by each of 200 would be twice it."""


@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_random_messages_leave_the_window_as_good_as_new(window, talk, count):
    chance = random.Random(20261130)
    server = psutil.Process(window._process.pid)
    before_pixels = talk.shown().pixels
    before = server.memory_info().rss
    names = [row["name"] for row in talk.scene["parameters"]]
    values = [None, True, -1, 0, 1, 0.5, 1e300, "x", [], {}, [1, 2, 3], "auto", 1e-9, "\ud800", "a" * 200]
    for _ in range(count):
        kind = chance.choice(
            ["look", "edit", "undo", "redo", "pick", "measure", "keep_view", "remove_view", "shown", "load"]
        )
        keys = ["parameter", "quality", "value", "light", "gesture", "take", "add_light", "remove_light"]
        keys += ["id", "x", "y", "camera", "size", "a", "b", "layer", "seconds", "source", "name", "path"]
        message = {key: chance.choice(values + names) for key in chance.sample(keys, 6)}
        talk.say(kind, **message)
    for text in ("", "[]", "nul", "{", '{"type": 7}', '{"type": "no"}', "[" * 5000):
        talk.say_text(text)
    # Messages are answered in their order: what comes after this is of what is said from now on.
    talk.say("pick", id=999, x=0.5, y=0.5, camera=talk.scene["camera"], seconds=None)
    while talk.message("picked")["id"] != 999:
        pass
    while True:
        talk.say("undo")
        if not talk.message("state")["can_undo"]:
            break
    assert (talk.shown().pixels == before_pixels).all()
    assert talk.notices and all("\n" not in each["text"] for each in talk.notices)
    assert not [each["text"] for each in talk.notices if "a defect" in each["text"]]
    assert server.memory_info().rss - before < GROWTH


def test_a_killed_drawing_process_is_started_again(window, talk):
    before = talk.shown().pixels
    # The drawing process is the one that holds the scene: the first that the server started.
    children = psutil.Process(window._process.pid).children()
    for child in children:
        if "spawn_main" in " ".join(child.cmdline()):
            os.kill(child.pid, signal.SIGKILL)
    notice = talk.message("notice")
    assert notice["level"] == "error" and "is started again" in notice["text"]
    assert (talk.shown().pixels == before).all()


def test_a_closed_window_leaves_no_process(own_cache, scene_file, config_file):
    window = vpltune.view(scene_file, config_file)
    server = psutil.Process(window._process.pid)
    everyone = [server, *server.children(recursive=True)]
    window.close()
    psutil.wait_procs(everyone)  # for ever, where one outlives the window
    with pytest.raises(MachineError, match="the window is closed"):
        _ = window.config


def test_the_page_and_its_policy(window):
    with urllib.request.urlopen(window.address) as answer:
        assert answer.headers["Content-Security-Policy"].startswith("default-src 'self'")
        assert b"<html" in answer.read()
    for path in ("../server.py", "%2e%2e/server.py", "nothing.js", "session.py"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(window.address + path)


def test_pages_of_strangers_are_refused(window):
    address = window.address.replace("http", "ws", 1) + "socket"
    with pytest.raises(InvalidStatus) as refused, connect(address, origin="http://elsewhere.example"):
        pass
    assert refused.value.response.status_code == 403
    assert "another site" in refused.value.response.body.decode()


@pytest.mark.parametrize(
    ("hosts", "origins", "reason"),
    [
        (["127.0.0.1:8321"], ["http://127.0.0.1:8321"], None),
        (["localhost:8321"], [], None),
        (["[::1]:8321"], ["http://[::1]:8321"], None),
        # A stranger's name that points to this machine: the browser takes page and socket for one site.
        (["rebound.example"], ["http://rebound.example"], "not this machine's"),
        (["127.0.0.1:8321"], ["http://127.0.0.1:9999"], "another site"),
        (["127.0.0.1:8321"], ["null"], "another site"),
        (["127.0.0.1:8321", "x"], [], "must be there once"),
        ([], [], "must be there once"),
    ],
)
def test_who_may_talk_to_a_window_of_this_machine(hosts, origins, reason):
    refusal = Admission("127.0.0.1").refusal("/socket", hosts, origins)
    assert (refusal is None) if reason is None else (refusal is not None and reason in refusal)


def test_beyond_this_machine_a_page_needs_the_token(own_cache, scene_file, config_file):
    with vpltune.view(scene_file, config_file, host="0.0.0.0") as window:
        base, _, query = window.address.replace("0.0.0.0", "127.0.0.1").partition("?")
        socket = base.replace("http", "ws", 1) + "socket"
        for wrong in ("", "?token=", "?token=" + "x" * 22):
            with pytest.raises(InvalidStatus, match="403"), connect(socket + wrong):
                pass
        with connect(f"{socket}?{query}") as connection:
            assert json.loads(connection.recv())["type"] == "scene"


def test_what_cannot_be_opened_is_said_in_one_line(own_cache, tmp_path, scene_file):
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF")
    cases = [
        ((broken, "default"), {}, "broken.glb"),
        ((tmp_path / "none.glb", "default"), {}, "no such file"),
        ((scene_file, tmp_path / "none.json"), {}, "none.json"),
        ((scene_file, "default"), {"host": "no.such.host.invalid"}, "--host no.such.host.invalid"),
    ]
    for arguments, keywords, part in cases:
        with pytest.raises(InputError, match=part) as refused:
            vpltune.view(*arguments, **keywords)
        assert "\n" not in str(refused.value)
