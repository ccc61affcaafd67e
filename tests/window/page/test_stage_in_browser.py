"""The camera and the lights moved with real mouse and keys, against a server that the test plays.

Coordinates are compared within 1e-6 where only double precision matters. Pointer places are whole pixels.
"""

import numpy as np
import pytest
from faked_window import CAMERA, SPOT, opened_window


def eye(look):
    return np.array(look["camera"]["to_world"])[[3, 7, 11]]


def test_an_orbit_turns_about_the_surface_under_the_pointer(window):
    pivot = np.array([0.5, 1.0, 1.0])
    window.surface = {"position": pivot.tolist(), "normal": [0, 0, 1], "distance": 4.0}
    # Off the middle, where the light's marker would be pressed.
    before = len(window.sent("look"))
    window.page.mouse.move(*window.place(0.4, 0.6))
    window.page.mouse.down()
    window.wait_for(lambda: window.sent("pick"), "a pick")
    pick = window.sent("pick")[-1]
    assert (pick["x"], pick["y"]) == pytest.approx((0.4, 0.6), abs=1 / 400)  # whole pixels
    window.page.wait_for_timeout(50)  # lets the answer arrive before the first move
    for step in range(1, 6):
        window.page.mouse.move(*window.place(0.4 + 0.02 * step, 0.6 + 0.01 * step))
        window.page.wait_for_timeout(20)
    window.page.mouse.up()
    window.wait_for_rest()
    looks = window.sent("look")[before:]
    assert len(looks) >= 3
    assert [look["look"] for look in looks] == sorted({look["look"] for look in looks})
    assert all(look["moving"] for look in looks[:-1])
    start = np.linalg.norm(eye({"camera": CAMERA}) - pivot)
    assert np.linalg.norm(eye(looks[-1]) - pivot) == pytest.approx(start, abs=1e-6)
    # The pointer went right and down: the camera went left and up.
    assert eye(looks[-1])[0] < 0
    assert eye(looks[-1])[1] > 1


def test_the_wheel_goes_towards_the_surface_and_stops_before_it(window):
    window.surface = {"position": [0.0, 1.0, 1.0], "normal": [0, 0, 1], "distance": 4.0}
    window.page.mouse.move(*window.place(0.5, 0.5))
    for _ in range(30):
        window.page.mouse.wheel(0, -200)
        window.page.wait_for_timeout(10)
    window.wait_for_rest()
    # The first notches aim at what is taken for the surface until the answer comes.
    assert 1.0 < eye(window.sent("look")[-1])[2] < 1.1


def test_keys_and_views_move_the_camera(window):
    page = window.page
    page.focus("#stage")
    page.keyboard.press("ArrowLeft")
    window.wait_for_rest()
    assert eye(window.sent("look")[-1])[0] < 0
    page.keyboard.press("Home")
    window.wait_for(lambda: window.sent("look")[-1]["camera"] == CAMERA, "the start")
    page.click('[data-view="door"] .go')
    window.wait_for(lambda: window.sent("look")[-1]["camera"]["yfov"] == 0.8, "the view")
    page.fill("#view-name", "window seat")
    page.keyboard.press("Enter")
    window.wait_for(lambda: window.sent("keep_view"), "a kept view")
    assert window.sent("keep_view")[-1]["name"] == "window seat"
    page.click('[data-view="door"] button[aria-label="Remove door"]')
    window.wait_for(lambda: window.sent("remove_view"), "a removed view")


def test_those_who_want_less_motion_get_one_step(chromium):
    with opened_window(chromium, reduced_motion="reduce") as window:
        window.page.click('[data-view="door"] .go')
        window.wait_for(lambda: window.sent("look")[-1]["camera"]["yfov"] == 0.8, "the view")
        assert {look["camera"]["yfov"] for look in window.sent("look")} == {1, 0.8}


def test_flight_moves_by_keys_while_the_right_button_is_held(window):
    page = window.page
    page.mouse.move(*window.place(0.5, 0.5))
    page.keyboard.press("w")
    page.mouse.down(button="right")
    page.keyboard.down("w")
    window.wait_for(lambda: eye(window.sent("look")[-1])[2] < 4.9, "a flight forwards")
    page.keyboard.up("w")
    page.mouse.up(button="right")
    assert eye(window.sent("look")[-1])[:2] == pytest.approx([0, 1], abs=1e-6)


def test_an_arrow_moves_a_light_along_its_axis_only(window):
    page = window.page
    page.click('[data-light="0"]')
    window.send_image((40, 40, 40))
    box = page.locator('[data-handle="x"] .tip').bounding_box()
    start = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    window.drag(start, (start[0] + 60, start[1] + 25))
    window.wait_for_rest()
    edits = window.sent("edit")
    assert len({edit["gesture"] for edit in edits}) == 1
    light = edits[-1]["value"]
    assert light["position"][1:] == SPOT["position"][1:]
    # 60 pixels at depth 5: the field of view is 1 radian over the stage's height. The pointer also leaves the
    # axis by 25 pixels, and seen from above the nearest point lies up to 1 % farther back.
    height = page.locator("#stage").bounding_box()["height"]
    assert light["position"][0] == pytest.approx(60 * 2 * 5 * np.tan(0.5) / height, rel=1e-2)
    assert {key: light[key] for key in ("direction", "intensity", "range")} == {
        key: SPOT[key] for key in ("direction", "intensity", "range")
    }


def test_the_handle_of_the_direction_follows_the_pointer(window):
    page = window.page
    page.click('[data-light="0"]')
    handle = '[data-handle="direction"] .tip'
    box = page.locator(handle).bounding_box()
    start = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
    end = start + np.array([30, -40])
    window.drag(tuple(start), tuple(end))
    window.wait_for_rest()
    assert np.linalg.norm(window.sent("edit")[-1]["value"]["direction"]) == pytest.approx(1.0, abs=1e-9)
    box = page.locator(handle).bounding_box()
    # Within two pixels, as the handle is drawn to a tenth and its box is that of its outline.
    assert (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2) == pytest.approx(tuple(end), abs=2)


def test_a_light_goes_to_a_clicked_surface(window):
    page = window.page
    page.click('[data-marker="0"]')
    page.wait_for_selector('[data-light="0"][aria-selected="true"]')
    window.surface = {"position": [1.0, 0.0, 0.5], "normal": [0, 1, 0], "distance": 4.0}
    page.keyboard.press("g")
    page.mouse.click(*window.place(0.7, 0.8))
    window.wait_for(lambda: window.sent("edit"), "an edit")
    # A hundredth of the diagonal of 4 × 2 × 4 off the floor.
    assert window.sent("edit")[-1]["value"]["position"] == pytest.approx([1, 0.06, 0.5], abs=1e-9)


def test_lights_are_added_edited_and_removed(window):
    page = window.page
    page.click("#add-point")
    window.wait_for(lambda: window.sent("edit"), "an added light")
    added = window.sent("edit")[-1]["add_light"]
    assert added["type"] == "point"
    window.send({**window.state, "lights": [SPOT, added]})
    page.wait_for_selector('[data-light="1"][aria-selected="true"]')
    assert not page.is_visible('[data-field="outer_cone"]')
    page.fill('[data-field="strength"]', "7")
    page.keyboard.press("Enter")
    window.wait_for(lambda: window.sent("edit")[-1].get("light") == 1, "an edited light")
    assert max(window.sent("edit")[-1]["value"]["intensity"]) == 7
    page.focus("#stage")
    page.keyboard.press("Delete")
    window.wait_for(lambda: window.sent("edit")[-1].get("remove_light") == 1, "a removed light")
