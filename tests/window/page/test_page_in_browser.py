"""Panel, panes and connection with real mouse and keys, against a server that the test plays."""

import pytest
from faked_window import CAMERA, config_message, opened_window, scene_message, state_message

SLIDER = '[data-parameter="intensity"] input[type=range]'
NUMBER = '[data-parameter="intensity"] input.number'


def test_it_looks_first_and_shows_what_comes(window):
    look = window.sent("look")[-1]
    box = window.page.locator("#stage").bounding_box()
    assert look["size"] == [round(box["width"]), round(box["height"])]
    assert look["camera"] == CAMERA
    assert (look["a"], look["b"], look["layer"], look["seconds"]) == ("hand", None, "image", None)
    assert look["error_of"] == "hand"
    window.send_image((200, 100, 50))
    window.wait_for(lambda: window.sent("shown"), "shown")
    assert window.sent("shown")[-1]["look"] == look["look"]
    assert window.colour_at(0.5, 0.5) == [200, 100, 50]
    assert "settled" in window.page.inner_text("#label-a")
    assert "12 ms" in window.page.inner_text("#label-a")
    assert window.page.title() == "hall.glb – VPLtune"


def test_an_older_image_is_acknowledged_but_not_shown(window):
    look = window.sent("look")[-1]["look"]
    window.page.keyboard.press("l")
    window.wait_for(lambda: window.sent("look")[-1]["look"] > look, "a newer look")
    assert "waiting" in window.page.inner_text("#label-a")
    window.send_image((0, 200, 0))
    window.send_image((200, 0, 0), look=look)
    window.wait_for(lambda: len(window.sent("shown")) == 2, "two acknowledgements")
    assert window.colour_at(0.5, 0.5) == [0, 200, 0]


def test_a_drag_of_a_slider_is_one_gesture_and_moving(window):
    page = window.page
    box = page.locator(SLIDER).bounding_box()
    middle = box["y"] + box["height"] / 2
    window.drag((box["x"] + box["width"] / 2, middle), (box["x"] + box["width"] - 1, middle))
    window.wait_for_rest()
    edits = window.sent("edit")
    assert len(edits) > 1
    assert len({edit["gesture"] for edit in edits}) == 1
    assert all(edit["parameter"] == "intensity" for edit in edits)
    assert edits[-1]["value"] == 20.0
    assert any(look["moving"] for look in window.sent("look"))
    page.focus(NUMBER)
    page.keyboard.press("ArrowDown")
    window.wait_for(lambda: window.sent("edit")[-1]["gesture"] != edits[-1]["gesture"], "a new gesture")
    assert window.sent("edit")[-1]["value"] < 20.0


def test_keys_step_a_slider_and_shift_makes_it_finer(window):
    page = window.page
    page.focus(SLIDER)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowRight")
    window.wait_for(lambda: len(window.sent("edit")) == 2, "two edits")
    first, second = (edit["value"] for edit in window.sent("edit"))
    # A hundredth and a thousandth of the track of a factor of 400, rounded to four digits.
    assert first == pytest.approx(400**0.01, rel=1e-3)
    assert second / first == pytest.approx(400**0.001, rel=1e-3)
    page.keyboard.press("End")
    window.wait_for(lambda: window.sent("edit")[-1]["value"] == 20.0, "the end of the track")


def test_a_double_click_resets_in_the_gesture_of_its_first_press(window):
    box = window.page.locator(SLIDER).bounding_box()
    window.page.mouse.dblclick(box["x"] + box["width"] * 0.8, box["y"] + box["height"] / 2)
    window.wait_for(lambda: window.sent("edit") and window.sent("edit")[-1]["value"] == 1.0, "the default")
    assert len({edit["gesture"] for edit in window.sent("edit")}) == 1


def test_a_typed_number_is_clamped_and_nonsense_is_put_back(window):
    page = window.page
    page.fill(NUMBER, "99")
    page.keyboard.press("Enter")
    window.wait_for(lambda: window.sent("edit"), "an edit")
    assert window.sent("edit")[-1]["value"] == 20.0
    page.fill(NUMBER, "much")
    page.keyboard.press("Enter")
    assert page.input_value(NUMBER) == "20"
    page.fill('[data-parameter="vpl_count"] input.number', "700.4")
    page.keyboard.press("Enter")
    window.wait_for(lambda: window.sent("edit")[-1].get("parameter") == "vpl_count", "a count")
    assert window.sent("edit")[-1]["value"] == 700


def test_moving_a_slider_shows_the_config_by_hand(window):
    page = window.page
    page.click('[data-source="default"]')
    window.wait_for(lambda: window.sent("look")[-1]["a"] == "default", "default in a")
    assert page.inner_text("#values-of") == "default"
    page.focus(SLIDER)
    page.keyboard.press("ArrowRight")
    window.wait_for(lambda: window.sent("look")[-1]["a"] == "hand", "by hand in a")
    assert page.get_attribute('[data-source="hand"]', "aria-pressed") == "true"


def test_what_a_prior_sets_is_shown_and_fixed(window):
    configs = {**window.state["configs"], "auto": config_message(intensity=1.25)}
    window.send({**window.state, "configs": configs})
    window.page.click('[data-source="auto"]')
    window.wait_for(lambda: window.sent("look")[-1]["a"] == "auto", "auto in a")
    window.send_image((1, 2, 3), parameters={"intensity": 1.5})
    window.wait_for(lambda: window.page.input_value(NUMBER) == "1.5", "the prior's value")
    assert window.page.is_disabled(SLIDER)
    assert not window.page.is_disabled('[data-parameter="vpl_count"] input[type=range]')


def test_number_keys_compare_and_missing_sources_say_why(window):
    page = window.page
    page.keyboard.press("Digit5")
    page.keyboard.press("Shift+Digit1")
    window.wait_for(lambda: window.sent("look")[-1]["b"] == "default", "a split")
    assert window.sent("look")[-1]["a"] == "reference"
    tuned = page.locator('[data-source="tuned"]')
    assert tuned.is_disabled()
    assert tuned.get_attribute("title") == "Tuned: no fit yet"
    page.keyboard.press("Digit2")
    page.keyboard.press("x")
    window.wait_for(lambda: window.sent("look")[-1]["b"] == "reference", "swapped")
    page.keyboard.press("Digit0")
    window.wait_for(lambda: window.sent("look")[-1]["b"] is None, "no split")
    page.keyboard.press("l")
    window.wait_for(lambda: window.sent("look")[-1]["layer"] == "albedo", "the next layer")


def test_the_split_line_divides_the_image(window):
    page = window.page
    page.keyboard.press("Shift+Digit1")
    window.wait_for(lambda: window.sent("look")[-1]["b"] == "default", "a split")
    window.send_image((250, 0, 0))
    window.send_image((0, 0, 250), pane="b", source="default")
    window.wait_for(lambda: len(window.sent("shown")) == 2, "both shown")
    assert (window.colour_at(0.45, 0.5), window.colour_at(0.55, 0.5)) == ([250, 0, 0], [0, 0, 250])
    window.drag(window.place(0.5, 0.7), window.place(0.25, 0.7))
    page.focus("#split-line")
    page.keyboard.press("ArrowRight")
    window.wait_for(lambda: page.get_attribute("#split-line", "aria-valuenow") == "27", "a step of the line")
    assert (window.colour_at(0.25, 0.5), window.colour_at(0.45, 0.5)) == ([250, 0, 0], [0, 0, 250])


def test_an_error_waits_for_its_reference(window):
    page = window.page
    page.keyboard.press("Digit6")
    window.wait_for(lambda: window.sent("look")[-1]["a"] == "signed_error", "the error")
    window.send_image(None, share=0.25)
    window.wait_for(lambda: "25 %" in page.inner_text("#message-a"), "how far the reference is")
    assert page.is_visible("#key-signed_error")
    assert not page.is_visible("#key-flip")
    page.select_option("#error-of", "default")
    window.wait_for(lambda: window.sent("look")[-1]["error_of"] == "default", "the error of default")


def test_a_fit_shows_how_it_goes_and_what_came_of_it(window):
    page = window.page
    page.click("#tune")
    window.wait_for(lambda: window.sent("tune"), "a fit")
    fit = {**window.state["fit"], "running": True, "stage": "references", "share": 0.4, "seconds_left": 75.0}
    window.send({**window.state, "fit": {**fit, "losses": [1.0, 0.1], "parameters": {"intensity": 4.0}}})
    window.wait_for(lambda: page.inner_text("#tune") == "Stop", "the button's word")
    assert page.inner_text("#fit-stage") == "References"
    assert "40 %" in page.inner_text("#fit-time")
    assert "1 min 15 s left" in page.inner_text("#fit-time")
    assert page.is_visible('[data-parameter="intensity"] .ghost')
    page.keyboard.press("t")
    window.wait_for(lambda: window.sent("stop"), "the end of the fit")
    ended = {**window.state["fit"], "status": "kept", "sentence": "kept: no view became better"}
    window.send({**window.state, "fit": ended})
    window.wait_for(lambda: page.inner_text("#tune") == "Tune", "the button's word")
    assert page.inner_text("#fit-sentence") == "kept: no view became better"
    window.send({**window.scene, "tuning": "the scene has no light"})
    page.wait_for_selector("#tune:disabled")
    assert page.inner_text("#fit-sentence") == "the scene has no light"


def test_undo_names_what_it_undoes_and_saving_knows_the_usual_path(window):
    page = window.page
    window.send({**window.state, "can_undo": True, "undo_name": "intensity", "unsaved": True})
    page.wait_for_selector('#undo[title="Undo intensity"]')
    assert page.title().startswith("● ")
    page.keyboard.press("Control+z")
    window.wait_for(lambda: window.sent("undo"), "undo")
    page.keyboard.press("Control+s")
    window.wait_for(lambda: window.sent("save"), "save")
    assert window.sent("save")[-1] == {"type": "save", "what": "config", "path": None}
    page.click("#open-files")
    page.fill("#path-views", "/elsewhere/views.json")
    page.keyboard.press("Enter")
    window.wait_for(lambda: len(window.sent("save")) == 2, "save as")
    assert window.sent("save")[-1] == {"type": "save", "what": "views", "path": "/elsewhere/views.json"}


def test_the_passes_are_measured_and_drawn(window):
    page = window.page
    page.keyboard.press("m")
    window.wait_for(lambda: window.sent("measure"), "measure")
    assert window.sent("measure")[-1]["source"] == "hand"
    passes = [["gather", 6.0], ["visibility_maps", 2.0]]
    window.send({"type": "timings", "source": "hand", "passes": passes, "milliseconds": 8.5})
    page.wait_for_selector('[data-pass="visibility_maps"]')
    widths = [page.locator(f'[data-pass="{name}"]').bounding_box()["width"] for name, _ in passes]
    assert widths[0] / widths[1] == pytest.approx(3.0, rel=0.02)  # whole pixels
    assert "8.5 ms" in page.inner_text("#pass-total")


def test_errors_stay_and_are_text(window):
    page = window.page
    window.send({"type": "notice", "level": "error", "text": "<b>x.json</b>: key 'intensity' is missing"})
    page.wait_for_selector("#toasts [role=alert]")
    assert page.inner_text("#toasts span") == "<b>x.json</b>: key 'intensity' is missing"
    page.click('#toasts button[aria-label="Dismiss"]')
    assert page.locator("#toasts .toast").count() == 0


def test_the_animation_is_scrubbed_and_played(chromium):
    with opened_window(chromium, scene_message(seconds=2.0)) as window:
        page = window.page
        page.keyboard.press("Space")
        window.wait_for(lambda: (window.sent("look")[-1]["seconds"] or -1) >= 0, "an animation time")
        asked = len(window.sent("look"))
        page.wait_for_timeout(400)
        # No image came, so no other time was asked for, and the page did not think that it was at rest.
        assert len(window.sent("look")) == asked
        first = window.sent("look")[-1]
        assert first["moving"]
        window.send_image((9, 9, 9))
        window.wait_for(lambda: window.sent("look")[-1]["seconds"] > first["seconds"], "a later time")
        page.keyboard.press("Space")
        window.wait_for_rest()
        page.click("#rest-pose")
        window.wait_for(lambda: window.sent("look")[-1]["seconds"] is None, "the rest pose")
        assert window.problems == []


def test_a_lost_connection_is_told_and_comes_back_to_the_same_view(window):
    page = window.page
    page.keyboard.press("ArrowLeft")
    window.wait_for_rest()
    camera = window.sent("look")[-1]["camera"]
    assert camera != CAMERA
    window.forget()
    window.socket.close()
    page.wait_for_selector("#lost:not([hidden])")
    window.wait_for(lambda: window.sent("look"), "a look after the connection is back")
    assert window.sent("look")[0]["camera"] == camera
    page.wait_for_selector("#lost", state="hidden")


def test_a_reload_comes_back_to_the_same_view(window):
    page = window.page
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Shift+Digit1")
    window.wait_for_rest()
    kept = window.sent("look")[-1]
    window.forget()
    page.reload()
    window.wait_for_rest()
    assert {**window.sent("look")[-1], "look": 0} == {**kept, "look": 0}


@pytest.mark.parametrize("width", [1024, 1440])
def test_long_names_break_no_layout(chromium, width):
    name = "a_scene_with_a_very_long_name_" * 8 + ".glb"
    views = [{"name": "view " * 60, "split": "held_out", "camera": CAMERA}]
    state = state_message(views=views, can_undo=True, undo_name="extinction coefficient " * 4)
    with opened_window(
        chromium, scene_message(name=name), state, viewport={"width": width, "height": 700}
    ) as window:
        page = window.page
        page.keyboard.press("Shift+Digit1")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate("document.querySelector('#panel').scrollWidth") <= page.evaluate(
            "document.querySelector('#panel').clientWidth"
        )
        assert page.locator("#compare").bounding_box()["height"] < 40  # one row
        for button in ("#open-files", "#toggle-panel", "#undo"):
            box = page.locator(button).bounding_box()
            assert box["x"] + box["width"] <= width
        assert window.problems == []


def test_every_control_has_a_name_and_the_keys_are_listed(window):
    page = window.page
    page.click('[data-light="0"]')
    nameless = page.evaluate(
        """[...document.querySelectorAll("button, input, select, [role=separator]")].filter((control) =>
          !control.getAttribute("aria-label") && !control.labels?.length && !control.textContent.trim()
        ).map((control) => control.outerHTML)"""
    )
    assert nameless == []
    page.keyboard.press("?")
    page.wait_for_selector("#help[open]")
    assert "put the selected light on a surface" in page.inner_text("#key-list")
    page.keyboard.press("Escape")
    assert page.locator("#help[open]").count() == 0
