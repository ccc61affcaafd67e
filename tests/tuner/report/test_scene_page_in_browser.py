"""The page of a fit in a real browser: images, slider, exposure, keyboard, print, dark, narrow, no script."""

import json

import numpy as np
import pytest
from opened_page import opened
from planted_metrics import PLANTED, change_metrics

from vpltune.cli.program import run
from vpltune.tuner.evaluation.view_images import VARIANTS, read_view_images
from vpltune.tuner.metrics.tone_curve import display_image
from vpltune.tuner.report.fit_folder import read_fit_folder
from vpltune.tuner.report.page_template import MAXIMUM_PAGE_BYTES
from vpltune.tuner.report.scene_page import scene_page
from vpltune.tuner.report.view_blocks import view_block

SHOWN = ("reference", *VARIANTS)


@pytest.fixture(scope="module")
def page_path(fitted_folder):
    assert run(["report", str(fitted_folder)]) == 0
    return fitted_folder / "report.html"


@pytest.fixture(scope="module")
def images(fitted_folder):
    return read_view_images(fitted_folder / "images.npz")


def test_it_opens_without_a_complaint_or_a_request_and_is_small(chromium, page_path):
    with opened(chromium, page_path) as shown:
        assert shown.page.title() == "cornell-box · VPLtune"
        assert shown.page.locator(".view").count() == 2
        assert shown.problems == []
        assert shown.requests == []
    assert page_path.stat().st_size < MAXIMUM_PAGE_BYTES <= 8e6


def test_the_page_itself_forbids_requests(chromium, page_path):
    """Requests and scripts that an injected script would try are blocked by the page's policy."""
    with opened(chromium, page_path) as shown:
        failures = []
        shown.page.on("requestfailed", lambda request: failures.append((request.url, request.failure)))
        refused = shown.page.evaluate("fetch('https://example.org/').then(() => 'sent', () => 'refused')")
        assert refused == "refused"
        shown.page.evaluate(
            "document.body.append(Object.assign(new Image(), {src: 'https://example.org/a.png'}))"
        )
        shown.page.evaluate(
            "document.body.append(Object.assign(document.createElement('script'), {text: 'window.ran = 1'}))"
        )
        assert shown.page.evaluate("window.ran") is None
        assert all("Content Security Policy" in problem for problem in shown.problems)
        assert len(shown.problems) >= 3
        # Chromium reports the request of an image before the policy blocks it.
        assert shown.requests == [address for address, _ in failures]
        assert all(reason == "csp" for _, reason in failures)


def test_exposure_is_live_on_linear_values(chromium, page_path, images):
    """Every canvas matches the numpy twin of the tone curve, applied to the half floats on disk."""
    exposures = view_block(images[0], {}).linear["exposures"]
    with opened(chromium, page_path) as shown:
        shown.page.select_option("#layout", "side")
        for quantity, stops, words in (
            ("image", 0, "±0.0 EV"),
            ("image", 2.5, "+2.5 EV"),
            ("irradiance", 2.5, "+2.5 EV"),
            ("irradiance", -4, "−4.0 EV"),
        ):
            shown.page.select_option("#quantity", quantity)
            shown.page.locator("#exposure").fill(str(stops))
            shown.drawn(f"{quantity} {stops}")
            assert shown.page.locator(".exposure output").inner_text() == words
            for variant in SHOWN:
                whole = images[0].radiance(variant)
                linear = whole if quantity == "image" else images[0].indirect[variant]
                expected = display_image(linear, exposures[quantity] * 2.0**stops).astype(int)
                # The page computes radiance in another order of operations, so rounding may differ by a step.
                assert np.abs(shown.canvas(variant).astype(int) - expected).max() <= 1


def test_exposure_changes_what_is_seen_and_reset_brings_it_back(chromium, page_path):
    with opened(chromium, page_path) as shown:
        before = shown.photograph(".stack")
        shown.page.locator("#exposure").fill("3")
        shown.drawn("image 3")
        brighter = shown.photograph(".stack")
        assert brighter.mean() > before.mean() + 20.0
        shown.page.click("#reset")
        shown.drawn("image 0")
        shown.page.mouse.move(0, 0)
        np.testing.assert_array_equal(shown.photograph(".stack"), before)


def test_the_slider_parts_left_from_right(chromium, page_path):
    """At either end one image fills the pane; in between, each is on its side. By mouse and by keyboard."""
    with opened(chromium, page_path) as shown:
        page = shown.page
        page.select_option("#left", "default")
        page.select_option("#right", "reference")
        split = page.locator(".split").first

        def seen(value):
            split.fill(str(value))
            page.evaluate("document.querySelector('.divider').style.visibility = 'hidden'")
            return shown.photograph(".stack").astype(int)

        left, right, half = seen(100), seen(0), seen(50)
        middle = half.shape[1] // 2
        assert np.abs(left - right).max() > 20
        height = int(0.9 * half.shape[0])  # without the captions at the bottom
        np.testing.assert_array_equal(half[:height, : middle - 4], left[:height, : middle - 4])
        np.testing.assert_array_equal(half[:height, middle + 4 :], right[:height, middle + 4 :])

        box = split.bounding_box()
        page.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"])
        assert float(split.input_value()) == pytest.approx(25.0, abs=1.0)
        split.focus()
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowRight")
        assert float(split.input_value()) == pytest.approx(26.0, abs=1.0)
        assert "default" in split.get_attribute("aria-valuetext")
        assert (
            page.locator(".divider").first.evaluate("e => getComputedStyle(e, '::after').outlineStyle")
            == "solid"
        )
        assert shown.problems == []


def test_side_by_side_shows_all_four(chromium, page_path):
    with opened(chromium, page_path) as shown:
        stack = shown.page.locator(".stack").first
        assert sum(figure.is_visible() for figure in stack.locator("figure").all()) == 2
        shown.page.select_option("#layout", "side")
        boxes = [figure.bounding_box() for figure in stack.locator("figure").all()]
        assert all(figure.is_visible() for figure in stack.locator("figure").all())
        assert len({box["x"] for box in boxes}) == 4
        assert len({box["y"] for box in boxes}) == 1


def test_pointing_at_a_pixel_reads_its_values(chromium, page_path, images):
    with opened(chromium, page_path) as shown:
        canvas = shown.page.locator(".truth canvas").first
        # The sentence above it may take several lines and push it off the screen.
        canvas.scroll_into_view_if_needed()
        box = canvas.bounding_box()
        shown.page.mouse.move(box["x"] + (20.5 / 32) * box["width"], box["y"] + (15.5 / 24) * box["height"])
        text = shown.page.locator(".probe output").first.inner_text()
        luminance = images[0].level * images[0].indirect["reference"][15, 20] @ [0.2126, 0.7152, 0.0722]
        assert "Pixel 20, 15" in text
        assert f"indirect irradiance {luminance:#.3g} W/m²" in text
        assert "tuned" in text


def test_the_keyboard_reaches_everything_and_can_skip(chromium, page_path):
    with opened(chromium, page_path) as shown:
        page = shown.page
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.className") == "skip"
        assert page.locator(".skip").bounding_box()["y"] >= 0.0
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.id") == "main"
        reached = []
        for _ in range(9):
            page.keyboard.press("Tab")
            reached.append(page.evaluate("document.activeElement.id || document.activeElement.className"))
        assert reached == [
            "exposure",
            "reset",
            "left",
            "right",
            "quantity",
            "layout",
            "sharp",
            "split",
            "split",
        ]
        assert page.evaluate("getComputedStyle(document.querySelector('#exposure')).outlineStyle") == "none"
        page.locator("#exposure").focus()
        assert page.evaluate("getComputedStyle(document.querySelector('#exposure')).outlineStyle") == "solid"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_in_light_and_dark(chromium, page_path, scheme):
    """Every text colour has a contrast of at least 4.5 on both backgrounds, as WCAG 2.2 (1.4.3) requires."""
    with opened(chromium, page_path, color_scheme=scheme) as shown:
        colours = shown.page.evaluate(
            """(names) => Object.fromEntries(names.map((name) => {
              const probe = document.body.appendChild(document.createElement("i"));
              probe.style.color = `var(--${name})`;
              return [name, getComputedStyle(probe).color.match(/[0-9.]+/g).slice(0, 3).map(Number)];
            }))""",
            ["paper", "card", "ink", "soft", "accent", "ceiling", "bad"],
        )

        def luminance(name):
            channels = np.array(colours[name]) / 255.0
            linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
            return float(linear @ [0.2126, 0.7152, 0.0722])

        assert (luminance("paper") > 0.5) == (scheme == "light")
        for text in ("ink", "soft", "accent", "ceiling", "bad"):
            for ground in ("paper", "card"):
                high, low = sorted((luminance(text), luminance(ground)), reverse=True)
                assert (high + 0.05) / (low + 0.05) >= 4.5, (text, ground)


@pytest.mark.parametrize("width", [320, 768, 1280])
def test_no_width_needs_scrolling_sideways(chromium, page_path, width):
    with opened(chromium, page_path, viewport={"width": width, "height": 800}) as shown:
        assert shown.page.evaluate("document.documentElement.scrollWidth") <= width


def test_in_print_sliders_lie_side_by_side(chromium, page_path):
    with opened(chromium, page_path) as shown:
        shown.page.locator("#exposure").fill("2")
        shown.drawn("image 2")
        shown.page.emulate_media(media="print")
        # In print every image has the exposure, even those that were never on the screen.
        drawn = ".view canvas:not([data-drawn='image 2'])"
        shown.page.wait_for_function("drawn => !document.querySelector(drawn)", arg=drawn)
        assert shown.page.locator(".view canvas").count() == 10
        stack = shown.page.locator(".stack").first
        assert all(figure.is_visible() for figure in stack.locator("figure").all())
        clip = stack.locator("figure.right canvas").evaluate("canvas => getComputedStyle(canvas).clipPath")
        assert clip == "none"
        assert not shown.page.locator(".toolbar").is_visible()
        assert not stack.locator(".split").is_visible()
        # An A4 page is 794 px (of 1/96 inch) wide, 718 px without margins of 1 cm.
        shown.page.set_viewport_size({"width": 718, "height": 1000})
        assert shown.page.evaluate("document.documentElement.scrollWidth") <= 718
        assert shown.page.pdf(format="A4", print_background=True).startswith(b"%PDF-")


def test_without_a_script_images_are_there_all_the_same(chromium, page_path, images):
    with opened(chromium, page_path, ready=None, java_script_enabled=False) as shown:
        stack = shown.page.locator(".stack").first
        assert all(image.is_visible() for image in stack.locator("img").all())
        assert not shown.page.locator(".toolbar").is_visible()
        exposure = view_block(images[0], {}).linear["exposures"]["image"]
        expected = display_image(images[0].radiance("tuned"), exposure)
        seen = shown.photograph('.stack figure[data-variant="tuned"] img')
        assert seen.mean(axis=(0, 1)) == pytest.approx(expected.mean(axis=(0, 1)), abs=3.0)


def test_parts_appear_where_the_fit_made_them(chromium, fit_copy):
    change_metrics(fit_copy, uncertainty=None)
    plain = scene_page(read_fit_folder(fit_copy))
    for heading in ("Error against frame time", "by cause", "trades off against"):
        assert heading not in plain
    change_metrics(fit_copy, **PLANTED)
    assert run(["report", str(fit_copy)]) == 0
    with opened(chromium, fit_copy / "report.html") as shown:
        text = shown.page.inner_text("main")
        for words in (
            "Error against frame time",
            "missing bounces",
            "0.8 to 1.3",
            "the scene",
        ):
            assert words in text
        assert "the prior" in text
        for words in (
            "3.75 ms",
            "predicted 3.5 ms",
            "640×480",
            "interleave 4, map size 16, RSM resolution 512",
        ):
            assert words in text
        assert shown.page.locator(".chart .named", has_text="budget 4 ms").count() == 1
        assert "intensity, extinction coefficient" in text
        assert shown.page.locator(".range .interval").count() == 2
        described = shown.page.locator(".chart desc").all_text_contents()
        assert any("3 configs, from 1 ms at relMSE 0.5 to 8 ms at relMSE 0.1" in words for words in described)
        assert shown.problems == []


HOSTILE = '<script>document.title="taken"</script><img src=x onerror=alert(1)>"\'&{{7*7}}</script>'


def test_names_from_scenes_are_text_and_nothing_else(chromium, fit_copy):
    document = json.loads((fit_copy / "metrics.json").read_text(encoding="utf-8"))
    change_metrics(
        fit_copy,
        scene=HOSTILE,
        sentence=HOSTILE,
        visibility=HOSTILE,
        notes=[HOSTILE],
        provenance={HOSTILE: HOSTILE, "command": HOSTILE},
        parameters={**document["parameters"], HOSTILE: 1.0},
        seconds={**document["seconds"], HOSTILE: 2.0},
        error_breakdown={"views": HOSTILE, HOSTILE: 1.0},
        uncertainty={"intensity": {"low": 0.5, "high": 2.0, "determined": True, "trades_with": [HOSTILE]}},
        pareto=[{"milliseconds": 1.0, "relmse": 1.0, "choice": {HOSTILE: HOSTILE}, "config": HOSTILE}],
        budget={"choice": {HOSTILE: HOSTILE}, "frame_size": [HOSTILE, 1]},
        per_view=[{**view, "name": HOSTILE, "split": HOSTILE} for view in document["per_view"]],
    )
    assert run(["report", str(fit_copy)]) == 0
    with opened(chromium, fit_copy / "report.html") as shown:
        assert shown.page.locator("script").count() == 2
        assert shown.page.locator("img[src=x]").count() == 0
        assert HOSTILE in shown.page.inner_text("h3")
        assert HOSTILE in shown.page.inner_text(".notes")
        assert shown.page.title() != "taken"
        assert shown.problems == []
        assert shown.requests == []
