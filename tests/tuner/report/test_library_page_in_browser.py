"""The page of a library in a real browser: sorting, filtering, links, mouse, keyboard, print and size."""

import json
import shutil
import zlib
from dataclasses import replace

import pytest
from opened_page import opened
from planted_metrics import change_metrics

from vpltune.cli.program import run
from vpltune.tuner.batch.record import Record, Records
from vpltune.tuner.evaluation.view_images import VARIANTS
from vpltune.tuner.report.batch_folder import BatchFolder, read_batch_folder
from vpltune.tuner.report.library_page import library_page
from vpltune.tuner.report.library_rows import TunedRow, UntunedRow
from vpltune.tuner.report.page_template import MAXIMUM_PAGE_BYTES

HOSTILE = "<script>alert(1)</script>\"'&.glb"


def record_of(name, status="done", reason="the loss has settled", output="", seconds=2.0):
    return Record(
        key=f"key-{zlib.crc32(name.encode()):08x}",
        scene=f"/library/{name}",
        name=name,
        status=status,
        reason=reason,
        seconds=seconds,
        attempts=1 if status != "failed" else 4,
        output=output,
        host="here",
        finished="2026-01-02T03:04:05+00:00",
    )


def figures_of(default, tuned):
    scores = {"energy_ratio": 1.0, "flip": tuned / 10.0}
    one = {
        "default": {"relmse": default, **scores},
        "tuned": {"relmse": tuned, **scores},
        "ceiling": {"relmse": 0.01, **scores},
        "noise_floor": 1e-4,
    }
    return {"fitted": one, "held_out": one}


TUNED = {"hall.glb": (0.5, 0.3, 2.0), "cellar.glb": (2.0, 0.9, 30.0), "attic.glb": (0.1, 0.2, 11.0)}


def made_batch(folder, fitted_folder):
    """The output folder of a batch: three tuned scenes, and others with every other status."""
    records = Records(folder)
    for name, (default, tuned, seconds) in TUNED.items():
        output = f"scenes/{name.removesuffix('.glb')}"
        shutil.copytree(fitted_folder, folder / output)
        change_metrics(folder / output, metrics=figures_of(default, tuned))
        records.write(record_of(name, output=output, seconds=seconds))
    shutil.copytree(folder / "scenes" / "hall", folder / "scenes" / "damaged")
    shutil.copytree(folder / "scenes" / "hall", folder / "scenes" / "unlit")
    (folder / "scenes" / "damaged" / "metrics.json").write_text("{", encoding="utf-8")
    for record in (
        record_of("damaged.glb", output="scenes/damaged"),
        record_of("elsewhere.glb", output="../../etc"),
        record_of("odd.obj", "refused", "odd.obj: line 3: not a number <b>"),
        record_of("slow.glb", "failed", "ran for 600 s, the limit"),
        record_of("unlit.glb", "unlit", "no indirect light reaches the fitted views", output="scenes/unlit"),
        record_of(HOSTILE, "refused", HOSTILE),
    ):
        records.write(record)
    names = {record.name: record.key for key in records.known_keys() if (record := records.read(key))}
    listing = {"library": "/library", "scenes": {**names, "later.glb": "no-such-key"}}
    (folder / "library.json").write_text(json.dumps(listing), encoding="utf-8")
    return folder


@pytest.fixture
def batch_folder(fitted_folder, tmp_path):
    """A batch folder that a test may change."""
    return made_batch(tmp_path / "batch", fitted_folder)


@pytest.fixture(scope="module")
def library(fitted_folder, tmp_path_factory):
    """The page of a batch folder that no test changes."""
    folder = made_batch(tmp_path_factory.mktemp("library") / "batch", fitted_folder)
    # Two scenes have no readable fit. The command writes the others and returns 4, "partly done".
    assert run(["report", str(folder)]) == 4
    return folder / "index.html"


def names_in(page, table="#tuned"):
    return page.locator(
        f"{table} tbody tr:visible th a, {table} tbody tr:visible th:not(:has(a))"
    ).all_inner_texts()


def test_it_opens_worst_first_with_totals_and_reasons(chromium, library, capfd):
    with opened(chromium, library, ready=None) as shown:
        assert names_in(shown.page) == ["cellar.glb", "hall.glb", "attic.glb"]
        assert shown.page.locator("#tuned tbody img").count() == 9
        cards = shown.page.inner_text(".cards")
        assert "3 of 10" in cards
        assert "1 unlit, 2 refused, 1 failed, 2 unreadable, 1 waiting" in cards
        assert "2 of 3" in cards
        untuned = shown.page.inner_text("#untuned")
        assert "odd.obj: line 3: not a number <b>" in untuned
        assert "ran for 600 s, the limit" in untuned
        assert "later.glb" in untuned
        assert shown.page.locator("svg.dumbbells circle").count() == 9
        assert shown.problems == []
        assert shown.requests == []
    assert library.stat().st_size < MAXIMUM_PAGE_BYTES


def test_headings_sort_both_ways_by_mouse_and_by_keyboard(chromium, library):
    with opened(chromium, library, ready=None) as shown:
        page = shown.page
        heading = page.locator("#tuned thead th", has_text="time")
        heading.locator("button").click()
        assert names_in(page) == ["cellar.glb", "attic.glb", "hall.glb"]
        assert heading.get_attribute("aria-sort") == "descending"
        assert page.locator('#tuned th[aria-sort="descending"]').count() == 1
        heading.locator("button").click()
        assert names_in(page) == ["hall.glb", "attic.glb", "cellar.glb"]
        assert heading.get_attribute("aria-sort") == "ascending"
        scene = page.locator("#tuned thead th", has_text="scene").locator("button")
        scene.focus()
        page.keyboard.press("Enter")
        assert names_in(page) == ["attic.glb", "cellar.glb", "hall.glb"]
        page.keyboard.press("Space")
        assert names_in(page) == ["hall.glb", "cellar.glb", "attic.glb"]
        assert page.inner_text("[role=status]") == "Sorted by scene, descending"
        page.locator("#untuned thead th", has_text="attempts").locator("button").click()
        # The waiting scene has no attempts, and rows without a value come last.
        assert names_in(page, "#untuned")[0] in ("slow.glb", "unlit.glb")
        assert names_in(page, "#untuned")[-1] == "later.glb"
        page.locator("#untuned thead th", has_text="attempts").locator("button").click()
        assert names_in(page, "#untuned")[-1] == "later.glb"
        assert shown.problems == []


def test_the_filter_looks_at_names_status_and_reasons(chromium, library):
    with opened(chromium, library, ready=None) as shown:
        page = shown.page
        page.fill("#filter", "HALL")
        assert names_in(page) == ["hall.glb"]
        assert names_in(page, "#untuned") == []
        assert page.inner_text("#matches") == "1 of 10 scenes"
        page.fill("#filter", "failed limit")
        assert names_in(page, "#untuned") == ["slow.glb"]
        page.fill("#filter", "")
        assert len(names_in(page)) == 3
        assert page.inner_text("#matches") == ""


def test_a_scene_links_to_its_page_and_back(chromium, library):
    with opened(chromium, library, ready=None) as shown:
        shown.page.click("text=cellar.glb")
        shown.drawn("image 0")
        assert shown.page.inner_text("h1") == "cellar.glb"
        shown.page.click("text=Library")
        # An unlit scene has a page too.
        assert shown.page.locator("#untuned a").get_attribute("href") == "scenes/unlit/report.html"
        assert shown.page.inner_text("h1") == "Scene library"
        assert shown.problems == []


def test_names_and_reasons_are_text(chromium, library):
    with opened(chromium, library, ready=None) as shown:
        assert HOSTILE in names_in(shown.page, "#untuned")
        assert shown.page.locator("script").count() == 1
        assert shown.page.locator("#untuned td b, #untuned td script").count() == 0
        assert shown.problems == []


@pytest.mark.parametrize("width", [320, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_every_screen_and_prints(chromium, library, width, scheme):
    context = {"viewport": {"width": width, "height": 800}, "color_scheme": scheme}
    with opened(chromium, library, ready=None, **context) as shown:
        assert shown.page.evaluate("document.documentElement.scrollWidth") <= width
        ground = shown.page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (sum(map(int, ground[4:-1].split(","))) > 384) == (scheme == "light")
        shown.page.emulate_media(media="print")
        assert not shown.page.locator(".filter").is_visible()
        assert shown.page.locator("#tuned").is_visible()
        shown.page.set_viewport_size({"width": 718, "height": 1000})
        assert shown.page.evaluate("document.documentElement.scrollWidth") <= 718
        assert shown.page.pdf(format="A4").startswith(b"%PDF-")


def test_without_a_script_the_table_is_there(chromium, library):
    with opened(chromium, library, ready=None, java_script_enabled=False) as shown:
        assert names_in(shown.page) == ["cellar.glb", "hall.glb", "attic.glb"]
        assert not shown.page.locator(".filter").is_visible()
        assert shown.page.locator("#tuned thead button").first.is_disabled()


def test_problems_are_told_by_file(batch_folder, capfd):
    assert run(["report", str(batch_folder), "--json"]) == 4
    shown = capfd.readouterr()
    document = json.loads(shown.out)
    assert document["status"] == "partly done"
    assert len(document["pages"]) == 5
    assert any("damaged/metrics.json: not JSON" in problem for problem in document["problems"])
    assert "damaged/metrics.json: not JSON" in shown.err


def test_a_batch_without_listing_shows_all_its_records(batch_folder):
    (batch_folder / "library.json").unlink()
    batch = read_batch_folder(batch_folder)
    assert set(TUNED) < set(batch.records)
    assert batch.waiting == ()


def test_a_listing_that_is_none_is_refused(batch_folder, capfd):
    (batch_folder / "library.json").write_text('{"scenes": [1]}', encoding="utf-8")
    assert run(["report", str(batch_folder)]) == 2
    assert "library.json: key 'scenes' must be an object" in capfd.readouterr().err


def test_a_large_library_stays_within_the_pages_size(tmp_path):
    """The page drops thumbnails first, then the best scenes, and says how many it left out."""
    thumbnail = "data:image/jpeg;base64," + "A" * 4000
    row = TunedRow(
        name="",
        address="scenes/x/report.html",
        relmse=dict.fromkeys(VARIANTS, 0.1),
        energy_ratio=1.0,
        flip=0.1,
        seconds=10.0,
        fit="improved",
        sentence="the loss has settled",
        thumbnails={"reference": thumbnail, "tuned": thumbnail},
    )
    rows = [
        replace(row, name=f"rooms/{index:05d}.glb", relmse=dict.fromkeys(VARIANTS, index / 10000))
        for index in range(10_000)
    ]
    untuned = [UntunedRow(f"bad/{index}.glb", "refused", "<" * 500, 1, 0.1) for index in range(5_000)]
    page = library_page(BatchFolder(tmp_path, "/library", {}, ()), rows, untuned)
    assert 0.5 * MAXIMUM_PAGE_BYTES < len(page.encode("utf-8")) < MAXIMUM_PAGE_BYTES
    assert "rooms/09999.glb" in page
    assert "rooms/00000.glb" not in page
    assert "more tuned scenes, all better than these" in page
    assert "more are not listed" in page
