"""The exported page in a real browser: the runtime's image, moved by keys and pointer, nothing fetched."""

import dataclasses
import json
import re
import runpy

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room
from exported_frames import CONFIG, READER, SCENES, textured_room, with_parameters, with_resolution
from exported_page import image_of, page_text, web_view

from vpltune import Runtime
from vpltune.cli.program import run
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import FitNote
from vpltune.renderer.errors import InputError
from vpltune.renderer.export.scene_bundle import left_out, scene_bundle
from vpltune.renderer.export.web_page import web_page
from vpltune.renderer.frame.disc_samples import NORMAL_REACH, OFF_PLANE_FACTOR, SAMPLE_REACH
from vpltune.renderer.gpu.camera_uniforms import camera_uniforms
from vpltune.renderer.scene.light_faces import light_records
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.sun_faces import SunGrid
from vpltune.tuner.fitting.fit_density import DISC_FOOTPRINT

CELLS = with_parameters(
    CONFIG.seen_by("maps"), vpl_count=32, lloyd_iterations=2, falloff_footprint=DISC_FOOTPRINT
)
OF_DISCS = 5e-3
"""Share of the pixels in which discs may differ: a Lloyd iteration carries on how samples differ."""
READ_TARGET = """name => {
  const target = [vpltune.frame[name]].flat().at(-1);
  gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
  return target.textures.map((_, i) => {
    const texels = new Float32Array(4 * target.width * target.height);
    gl.readBuffer(gl.COLOR_ATTACHMENT0 + i);
    gl.readPixels(0, 0, target.width, target.height, gl.RGBA, gl.FLOAT, texels);
    return Array.from(texels);
  });
}"""


def default_of(config):
    """What the page's button draws: the table's defaults, at the same number of VPLs."""
    return config.with_parameters(ArtistParameters(vpl_count=config.parameters.vpl_count))


def assert_same(image, runtime, view, config, exposure=None, *, textured=False, but=1e-3):
    """To 3/255, where walls have textures to 8/255, in all but one pixel in a thousand.

    OpenGL leaves to the driver how textures are filtered at a slant: without anisotropy these walls agree to
    2/255. And rasterisers round corners to grids of their own, SwiftShader to 1/16 of a pixel: an edge
    that passes a pixel's centre closer than that may leave it on either side.
    """
    ours = runtime.render(view, config, exposure=exposure).astype(int)
    assert np.ptp(ours) > 100
    side_walls = np.abs(runtime.render(view, config, layer="normal")[..., 0]) > 0.9
    difference = np.abs(image - ours).max(axis=-1)
    differ = difference > np.where(side_walls & textured, 8, 3)
    assert differ.mean() < but, f"{differ.sum()} pixels, by up to {difference.max()}"


def assert_same_image(page, scene, view, config=CONFIG, **tolerance):
    runtime = Runtime(scene)
    assert_same(image_of(page), runtime, view, config, textured=bool(scene.textures), **tolerance)


@pytest.mark.parametrize(
    ("light", "visibility"),
    [
        ("spot", "unattenuated"),
        ("spot", "transmittance"),
        ("wide_spot", "maps"),
        ("point", "maps"),
        ("directional", "maps"),
    ],
)
def test_the_image_is_the_runtimes(opened, light, visibility):
    scene, view = textured_room(), web_view(light)
    if visibility == "unattenuated":
        config = with_parameters(CONFIG, extinction_coefficient=0.0)
    else:
        config = CONFIG.seen_by(visibility)
    assert_same_image(opened(page_text(scene, view, config)), scene, view, config)


def test_visibility_maps_are_cast_in_the_page(opened):
    scene, view, config = textured_room(), web_view("spot"), CONFIG.seen_by("maps")
    page = opened(page_text(scene, view, config))
    assert_same_image(page, scene, view, config)
    plain = Runtime(scene).render(view, CONFIG.seen_by("transmittance"))
    assert (np.abs(image_of(page) - plain).max(axis=-1) > 3).mean() > 0.1


@pytest.mark.parametrize("light", ["spot", "directional"])
def test_cells_shine_as_discs_in_the_page(opened, light):
    """In all pixels but a share of `OF_DISCS`: each step to a cell's middle carries on how samples differ.

    Rasterisers put edges of the RSM into other texels, which samples then follow. Between the runtime's own
    images from RSMs of 256² and 257², 16 to 22 pixels in a thousand differ so.
    """
    scene, view = colored_room(), web_view(light)
    page = opened(page_text(scene, view, CELLS))
    assert_same_image(page, scene, view, CELLS, but=OF_DISCS)
    cells = image_of(page)
    points = opened(page_text(scene, view, with_parameters(CELLS, lloyd_iterations=0)))
    assert (np.abs(image_of(points) - cells).max(axis=-1) > 3).mean() > 0.1


def test_cells_are_the_standalone_readers(opened):
    """From the page's own samples and length, so that nothing is left of the rasteriser: to 1e-4 of L."""
    page = opened(page_text(textured_room(), web_view("point"), CELLS))
    samples, vpls, moments = (
        np.hstack([np.reshape(texels, (-1, 4)) for texels in page.evaluate(READ_TARGET, target)])
        for target in ("samples", "vpls", "moments")
    )
    length = np.sqrt(moments[0, 4] / moments[0, 3] - np.square(moments[0, :3] / moments[0, 3]).sum())
    relaxed = runpy.run_path(str(READER.with_name("standalone_vpls.py")))["relaxed"]
    expected = samples[:32]
    for _ in range(CELLS.parameters.lloyd_iterations):
        reaches = (NORMAL_REACH, OFF_PLANE_FACTOR, SAMPLE_REACH)
        expected = relaxed(expected, samples[samples[:, 3] > 0.0], length, *reaches)
    assert np.linalg.norm(expected[:, :3] - samples[:32, :3], axis=1).max() > 0.1 * length
    np.testing.assert_allclose(vpls[:32, :4], expected[:, :4], atol=1e-4 * length)
    np.testing.assert_allclose(vpls[:32, 4:7], expected[:, 4:7], atol=1e-6)
    np.testing.assert_allclose(vpls[:32, 8:11], expected[:, 8:11], rtol=1e-4)


@pytest.mark.parametrize("light", ["spot", "directional"])
@pytest.mark.slow
def test_vpls_are_placed_by_what_the_camera_sees(opened, light):
    """And anew when it moves; the default, which is one click away, has discs and another η."""
    scene, view = colored_room(), web_view(light)
    config = with_parameters(CONFIG, vpl_count=32, density_importance=0.7)
    page = opened(page_text(scene, view, config))
    assert_same_image(page, scene, view, config)
    for _ in range(4):
        page.keyboard.press("ArrowLeft")
    camera = Camera(np.array(page.evaluate("vpltune.camera")), view.camera.yfov)
    there, exposure = dataclasses.replace(view, camera=camera), page.evaluate("vpltune.exposure")
    runtime = Runtime(scene)
    assert_same(image_of(page), runtime, there, config, exposure)
    page.keyboard.press("t")
    plain = default_of(config)
    assert (np.abs(image_of(page) - runtime.render(view, plain)).max(axis=-1) > 3).mean() > 0.1
    assert_same(image_of(page), runtime, there, plain, exposure, but=OF_DISCS)


def test_it_goes_on_being_the_runtimes_when_things_move(opened):
    """Camera and light by keys, parameters by a button; the runtime draws from where things then are.

    The spot ends at the floor, and so lights the walls alone that it meets before.
    """
    scene, view = colored_room(), web_view("spot", (96, 72))
    view = dataclasses.replace(view, lights=(dataclasses.replace(view.lights[0], range=2.2),))
    page = opened(page_text(scene, view))
    for key in ("ArrowLeft", "ArrowLeft", "ArrowUp", "+", "d", "d", "s"):
        page.keyboard.press(key)
    page.keyboard.press("r")
    assert_same_image(page, scene, view)
    for key in ("ArrowLeft", "ArrowLeft", "ArrowUp", "-", "d", "s"):
        page.keyboard.press(key)
    moved = page.evaluate("({ camera: vpltune.camera, lights: vpltune.lights })")
    camera = Camera(np.array(moved["camera"]), view.camera.yfov)
    assert np.linalg.norm(camera.position_world - view.camera.position_world) > 0.1
    light = dataclasses.replace(view.lights[0], position_world=np.array(moved["lights"][0]["position"]))
    assert np.linalg.norm(light.position_world - view.lights[0].position_world) > 0.05
    there = dataclasses.replace(view, camera=camera, lights=(light,))
    exposure = page.evaluate("vpltune.exposure")
    runtime = Runtime(scene)
    assert_same(image_of(page), runtime, there, CONFIG, exposure)
    page.keyboard.press("t")
    assert page.get_attribute("#default", "aria-pressed") == "true"
    assert_same(image_of(page), runtime, there, default_of(CONFIG), exposure, but=OF_DISCS)


def test_a_sun_turns_and_several_lights_are_chosen_among(opened):
    view = dataclasses.replace(
        web_view("spot", (48, 36)), lights=(ROOM_LIGHTS["directional"], ROOM_LIGHTS["point"])
    )
    page = opened(page_text(textured_room(), view))
    before, place = image_of(page), page.inner_text("#light-place")
    page.keyboard.press("d")
    assert page.inner_text("#light-place") != place
    assert (image_of(page) != before).any()
    assert np.hypot.reduce(page.evaluate("vpltune.lights[0].direction")) == pytest.approx(1.0)
    page.click("text=2: point")
    assert page.inner_text("#light-place").startswith("at ")


def test_exposure_pointer_and_sliders(opened):
    page = opened(page_text(textured_room(), web_view("spot", (48, 36))))
    plain = image_of(page)
    page.keyboard.press("]")
    assert page.inner_text("#exposure-value") == "+0.2 stops"
    assert image_of(page).mean() > plain.mean()
    page.keyboard.press("r")
    assert (image_of(page) == plain).all()
    box = page.locator("#image").bounding_box()
    page.mouse.move(box["x"] + 50, box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 120, box["y"] + 60, steps=3)
    page.mouse.up()
    assert (image_of(page) != plain).any()
    page.click("#reset")
    page.locator("#intensity").fill("2.5")
    assert image_of(page).mean() > plain.mean()
    assert page.get_attribute("#tuned", "aria-pressed") == "false"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_is_legible_in_the_dark_and_on_a_small_screen(opened, scheme):
    view = web_view("spot", (48, 36))
    page = opened(
        page_text(textured_room(), view), color_scheme=scheme, viewport={"width": 400, "height": 800}
    )
    style = "getComputedStyle(document.body)"
    colors = page.evaluate(f"[{style}.color, {style}.backgroundColor]")
    ink, paper = (np.mean([int(part) for part in re.findall(r"\d+", color)[:3]]) for color in colors)
    assert (paper - ink if scheme == "light" else ink - paper) > 150
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_names_cannot_break_out_and_what_is_left_out_is_said(opened):
    name = "</script><script>document.title='broken'</script>"
    config = dataclasses.replace(
        with_parameters(CONFIG, screen_space_strength=1.0), provenance={"scene": name}
    )
    scene = dataclasses.replace(textured_room(), name=name)
    page = opened(page_text(scene, web_view("spot", (16, 12)), config))
    assert page.title() == f"{name} – VPLtune"
    assert page.inner_text("h1") == name
    assert "near field is drawn by the runtime alone" in page.inner_text("#note")
    # Discs withhold nothing that a near field would give back.
    assert left_out(with_parameters(config, lloyd_iterations=8), (16, 12)) == ()


def test_the_page_says_what_the_config_says(opened):
    """Every parameter, wherever the file keeps it, how the fit ended, and where the numbers come from."""
    config = dataclasses.replace(CELLS, fit=FitNote("kept", "as good as before"), provenance={"seed": 7})
    page = opened(page_text(colored_room(), web_view("spot", (16, 12)), config))
    said = page.evaluate(
        "Object.fromEntries([...document.querySelectorAll('#provenance dt')]"
        ".map((term) => [term.textContent, term.nextElementSibling.textContent]))"
    )
    expected = {name.replace("_", " "): value for name, value in config.parameters.as_dict().items()}
    assert {name: float(said[name]) for name in expected} == expected
    others = {"visibility": "maps", "status": "kept", "fit": "as good as before", "seed": "7"}
    assert {name: text for name, text in said.items() if name not in expected} == others


def test_the_command_writes_one_file(tmp_path, capfd):
    output, scene = tmp_path / "page.html", str(SCENES / "gallery.glb")
    assert (
        run(["export", "default", "--to", "web", "--scene", scene, "-o", str(output), "--size", "64x48"]) == 0
    )
    text = output.read_text(encoding="utf-8")
    assert output.stat().st_size < 8e6
    assert not re.search(r"(src|href)=\"(?!data:)", text)
    document = json.loads(re.search(r'<script id="bundle"[^>]*>(.*?)</script>', text, re.S).group(1))
    assert document["scene"] == "gallery"
    assert run(["export", "default", "--to", "web", "--scene", scene, "-o", str(tmp_path / "page.htm")]) == 2
    assert "must end in .html" in capfd.readouterr().err


def test_a_view_without_light_is_refused():
    view = web_view(None, (16, 12))
    with pytest.raises(InputError, match="must have a light"):
        web_page(scene_bundle(textured_room(), view, CONFIG))


def test_the_bundles_faces_and_camera_are_the_runtimes():
    scene, view = textured_room(), web_view("point", (16, 12))
    document = scene_bundle(scene, view, with_resolution(CONFIG, 64)).document
    faces = light_records(view.lights, scene.bounds(), SunGrid(64, (0.0, 0.0, 0.0))).faces
    for face, theirs in zip(faces, document["rsm"]["faces"], strict=True):
        np.testing.assert_array_equal(face["light_to_world"].T, np.float32(theirs["light_to_world"]))
    assert (
        document["view"]["near_plane"] == camera_uniforms(view.camera, view.size, scene.bounds()).near_plane
    )
