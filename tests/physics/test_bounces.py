"""Light that is reflected more than once: closed forms, the series of bounces, scale, and open scenes."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, quad, room_view, scene_of

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE, Bounces, LightSettings
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.frame.frame import FrameSetup
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.frame.vpl_pools import VPL_BYTES, VplPools
from vpltune.renderer.frame.walk_samples import STEPS_OF_ALL
from vpltune.renderer.scene.scene import Camera, Light, Mesh, Scene, scaled
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, scaled_view

RADIANCE = np.array([3.0, 2.0, 1.0])
LAMP = Light("point", np.array([2.0, 1.5, 1.0]), np.array([0.1, 0.2, -0.1]))
FEW = ArtistParameters(vpl_count=128)
"""Where images are compared with one another, and visibility maps take time."""
BOUNCES: tuple[Bounces, ...] = (1, 2, 3, "all")


def config_of(bounces: Bounces, **changes) -> TunedConfig:
    """512 discs from a small RSM, gathered in full. Nothing is in the way of anything in a convex box, so
    that transmittance alone is right there."""
    config = TunedConfig(
        ArtistParameters(vpl_count=512),
        visibility="transmittance",
        quality=Quality(interleave=1, rsm_resolution=128),
        light=LightSettings(bounces),
    )
    return replace(config, **changes)


def walls_of_box(extent: tuple[float, float, float] = (2.0, 1.0, 1.5)) -> list[Mesh]:
    """The six walls of a closed box about the origin, facing inwards."""
    size = np.array(extent)
    walls = []
    for axis in range(3):
        u, v = (np.eye(3)[(axis + k) % 3] * size for k in (1, 2))
        walls.append(quad(-size / 2, u, v))
        walls.append(quad(-size / 2 + np.eye(3)[axis] * size, v, u))
    return walls


def box(albedo: float, radiance=(0.0, 0.0, 0.0)) -> Scene:
    """That box, all of one albedo, glowing everywhere or nowhere."""
    made = scene_of(walls_of_box(), [(albedo,) * 3], "box")
    return replace(made, materials=(replace(made.materials[0], emission=tuple(map(float, radiance))),))


def view_inside(*lights: Light) -> View:
    camera = Camera(look_at(np.array([-0.7, 0.1, 0.5]), np.array([0.6, -0.1, -0.4])), 1.2)
    return View("inside", "fitted", (32, 24), camera, lights)


def drawn(gl_context, scene: Scene, view: View, config: TunedConfig) -> CapturedFrame:
    return Runtime(scene, context=gl_context).capture(view, config, maps=False)


def indirect(gl_context, scene: Scene, view: View, config: TunedConfig) -> np.ndarray:
    """Mean indirect irradiance [W/m²], RGB."""
    captured = drawn(gl_context, scene, view, config)
    return captured.indirect_irradiance[captured.valid].mean(axis=0)


@pytest.mark.parametrize("bounces", BOUNCES)
@pytest.mark.parametrize("albedo", [0.5, 0.8, 0.9])
def test_a_furnace_gives_the_geometric_series(gl_context, albedo, bounces):
    """Where all walls glow evenly, E_direct = πL, and n bounces add πL·(ρ + … + ρⁿ), all πL·ρ/(1 − ρ).

    To 2.5 %: a disc in a corner is cut off where it would reach beyond the wall beside it, and so 256 glowing
    discs give 0.977 of the direct light, and all discs about as much of the reflected light.
    """
    captured = drawn(gl_context, box(albedo, RADIANCE), view_inside(), config_of(bounces))
    direct = captured.direct_irradiance[captured.valid].mean(axis=0)
    reflected = captured.indirect_irradiance[captured.valid].mean(axis=0)
    last = 1000 if bounces == "all" else int(bounces)
    series = sum(albedo**k for k in range(1, last + 1))
    np.testing.assert_allclose(direct, np.pi * RADIANCE, rtol=2.5e-2)
    np.testing.assert_allclose(reflected, series * np.pi * RADIANCE, rtol=2.5e-2)


@pytest.mark.parametrize("albedo", [0.5, 0.8, 0.9])
def test_many_discs_leave_less_in_the_corners(gl_context, albedo):
    """πL/(1 − ρ) with 2,048 VPLs, 1,024 of them on the walls as they glow, to 2 %."""
    config = config_of("all", parameters=ArtistParameters(vpl_count=2048))
    captured = drawn(gl_context, box(albedo, RADIANCE), view_inside(), config)
    irradiance = (captured.direct_irradiance + captured.indirect_irradiance)[captured.valid].mean(axis=0)
    np.testing.assert_allclose(irradiance, np.pi * RADIANCE / (1.0 - albedo), rtol=2e-2)


@pytest.mark.parametrize("albedo", [0.5, 0.9])
def test_walks_keep_all_the_light_of_a_furnace(gl_context, albedo):
    """All bounces reflect A π L ρ/(1 − ρ). To 0.1 %: which walks end by chance is evenly spread."""
    captured = drawn(gl_context, box(albedo, RADIANCE), view_inside(), config_of("all"))
    area = 2.0 * (2.0 * 1.0 + 1.0 * 1.5 + 1.5 * 2.0)
    expected = area * np.pi * RADIANCE * albedo / (1.0 - albedo)
    np.testing.assert_allclose(captured.vpl_flux.sum(axis=0), expected, rtol=1e-3)


def test_surfaces_that_light_reaches_late_have_discs_of_their_own(gl_context):
    """A flat box glows within and without, under a ceiling. What it emits never reaches its own top first.
    Near below the top is the inside of its bottom, which faces up as well, and is bright.

    The top reflects ρ times what the ceiling above it sends back, but for what leaves at the sides: at least
    half as much as that part of the ceiling.
    """
    inside = walls_of_box((0.3, 0.01, 0.3))
    outside = [replace(wall, triangles=wall.triangles[:, ::-1]) for wall in inside]
    glowing = [replace(wall, material=1) for wall in (*outside, *inside)]
    ceiling = quad((-0.5, 0.032, -0.5), (1, 0, 0), (0, 0, 1))
    made = scene_of([ceiling, *glowing], [(0.95,) * 3, (0.95,) * 3])
    made = replace(made, materials=(made.materials[0], replace(made.materials[1], emission=(1.0, 1.0, 1.0))))
    captured = drawn(gl_context, made, view_inside(), config_of("all", parameters=FEW))
    flux, place = captured.vpl_flux[:, 0], captured.vpl_position_world
    facing = captured.vpl_normal_world[:, 1]
    above = (facing < -0.9) & (place[:, 1] > 0.03) & (np.abs(place[:, [0, 2]]) < 0.15).all(axis=1)
    top = (facing > 0.9) & (np.abs(place[:, 1] - 0.005) < 1e-4)
    assert flux[top].sum() > 0.5 * flux[above].sum() > 0.0


@pytest.mark.parametrize("albedo", [0.3, 0.7])
def test_bounces_in_a_box_fall_by_the_albedo(gl_context, albedo):
    """A lamp in a closed box: all light that is reflected arrives, so that each bounce has ρ times the flux
    of the one before; to 1 %, as some rays pass through the edges. If no light walked on, there would be
    none.

    In the image too, but about: light is even only after some bounces, and the camera does not see all. To
    15 % of ρ.
    """
    scene, view = box(albedo), view_inside(LAMP)
    images = {}
    for bounces in BOUNCES:
        captured = drawn(gl_context, scene, view, config_of(bounces))
        first, later = captured.vpl_flux[:512].sum(axis=0), captured.vpl_flux[512:].sum(axis=0)
        last = 1000 if bounces == "all" else int(bounces)
        np.testing.assert_allclose(later / first, sum(albedo**k for k in range(1, last)), rtol=1e-2)
        images[bounces] = captured.indirect_irradiance[captured.valid].mean(axis=0)
    one, two, three, every = (images[bounces] for bounces in BOUNCES)
    assert (one < two).all() and (two < three).all() and (three < every).all()
    np.testing.assert_allclose((two - one) / one, albedo, rtol=0.15)
    np.testing.assert_allclose((three - two) / (two - one), albedo, rtol=0.15)
    np.testing.assert_allclose(every / one, 1.0 / (1.0 - albedo), rtol=0.15)


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_scale_changes_nothing(gl_context, factor):
    """Of radiance where surfaces glow and lamps are scaled with the scene: to 1e-3 relative RMSE, as rays may
    pass an edge on another side."""
    made = colored_room()
    lit = replace(made.materials[0], emission=(0.2, 0.3, 0.4))
    scene, view = replace(made, materials=(lit, *made.materials[1:])), room_view("point", (32, 24))
    images = [
        Runtime(each, context=gl_context).render_radiance(
            placed, config_of("all", visibility="maps", parameters=FEW)
        )
        for each, placed in ((scene, view), (scaled(scene, factor), scaled_view(view, factor)))
    ]
    assert images[0].mean() > 0.05
    error = np.sqrt(np.mean((images[1] - images[0]) ** 2) / np.mean(images[0] ** 2))
    assert error < 1e-3, error


@pytest.mark.parametrize("visibility", ["transmittance", "maps"])
def test_two_draws_are_the_same_bit_by_bit(gl_context, visibility):
    """Also with another image drawn between them, and by a runtime of its own."""
    scene, view = colored_room(), room_view("spot", (32, 24))
    config = config_of("all", visibility=visibility, parameters=FEW)
    runtime = Runtime(scene, context=gl_context)
    first = runtime.capture(view, config, maps=False).indirect_irradiance
    runtime.capture(room_view("point", (32, 24)), config_of(2, parameters=FEW), maps=False)
    np.testing.assert_array_equal(runtime.capture(view, config, maps=False).indirect_irradiance, first)
    np.testing.assert_array_equal(drawn(gl_context, scene, view, config).indirect_irradiance, first)
    assert first.mean() > 0.0


def test_no_light_is_gained_where_walks_leave_the_scene(gl_context):
    """A plain floor under a lamp reflects nothing to itself, and of two walls that meet, most light goes
    elsewhere: less than half of the ρ/(1 − ρ) that a closed room would have."""
    lamp = Light("point", np.full(3, 5.0), np.array([0.0, 0.6, 0.1]))
    camera = Camera(look_at(np.array([0.0, 1.0, 2.5]), np.zeros(3)), 0.8)
    view = View("open", "fitted", (16, 12), camera, (lamp,))
    floor = quad((-1, 0, -1), (0, 0, 2), (2, 0, 0))
    alone = scene_of([floor], [(0.7, 0.7, 0.7)])
    cornered = scene_of([floor, quad((-1, 0, -1), (2, 0, 0), (0, 2, 0))], [(0.7, 0.7, 0.7)])
    captured = drawn(gl_context, alone, view, config_of("all"))
    assert captured.vpl_flux[:512].any() and not captured.vpl_flux[512:].any()
    assert not captured.vpl_irradiance[captured.valid].any()
    captured = drawn(gl_context, cornered, view, config_of("all"))
    first, later = captured.vpl_flux[:512].sum(axis=0), captured.vpl_flux[512:].sum(axis=0)
    assert (later > 0.0).all() and (later < 0.5 * first * 0.7 / (1.0 - 0.7)).all()


def test_a_program_may_choose_walks_and_the_share_of_later_discs(gl_context):
    """A quarter of the walks and half of the discs: as much light, to 5 %, which is what walks are spread by;
    without the options it is that of the default."""
    view, options = room_view("spot", (32, 24)), RuntimeOptions(walks=1024, later_share=0.25)
    light = []
    for chosen, later in ((options, 128), (RuntimeOptions(), 256)):
        drawn = Runtime(colored_room(), chosen, context=gl_context).draw(view, config_of("all"))
        assert drawn.frame.setup.pools == VplPools(512, later)
        samples = drawn.frame.resources.buffer("later_samples").size
        assert samples == chosen.walks * STEPS_OF_ALL * VPL_BYTES
        light.append(drawn.capture(maps=False).vpl_flux[512:].sum(axis=0))
    np.testing.assert_allclose(light[0], light[1], rtol=0.05)
    assert (light[0] != light[1]).all()


@pytest.mark.parametrize(("name", "value"), [("walks", 0), ("walks", 4095), ("later_share", 0.0)])
def test_walks_that_cannot_be_are_refused(name, value):
    with pytest.raises(ValueError, match=f"{name}: must be .*, got {value}"):
        RuntimeOptions(**{name: value})


def test_one_bounce_without_glow_has_one_kind_of_vpls(gl_context):
    """And is drawn as if there were no walks: no ray is cast, and VPLs are those of the first kind, bit by
    bit, of an image with all bounces."""
    scene, view = colored_room(), room_view("spot", (32, 24))
    one = config_of(1)
    assert one.light == ONE_BOUNCE
    assert FrameSetup.of(view, one, 0, glows=False).pools == VplPools(512)
    runtime = Runtime(scene, context=gl_context)
    frame = runtime.draw(view, one).frame
    assert "later_samples" not in frame.resources and "ray_nodes" not in frame.resources
    alone = runtime.capture(view, one, maps=False)
    every = runtime.capture(view, config_of("all"), maps=False)
    assert len(alone.vpl_flux) == alone.asked_vpls == every.asked_vpls == 512 < len(every.vpl_flux)
    for name in ("vpl_position_world", "vpl_normal_world", "vpl_footprint", "vpl_flux"):
        np.testing.assert_array_equal(getattr(every, name)[:512], getattr(alone, name))
    np.testing.assert_array_equal(every.direct_irradiance, alone.direct_irradiance)
    assert (every.vpl_irradiance >= alone.vpl_irradiance).all()


@pytest.mark.parametrize("vpls", [16, pytest.param(20_000, marks=pytest.mark.slow)])
def test_points_have_later_bounces_too(gl_context, vpls):
    """Where the first VPLs are points, few or too many to be clustered; later ones are clustered always."""
    points = ArtistParameters(vpl_count=vpls, falloff_footprint=0.5, lloyd_iterations=0)
    scene, view = box(0.7), replace(view_inside(LAMP), size=(8, 6))
    one, every = (
        indirect(gl_context, scene, view, config_of(bounces, parameters=points)) for bounces in (1, "all")
    )
    # As in the box with discs; 16 points alone are off by as much again.
    np.testing.assert_allclose(every / one, 1.0 / 0.3, rtol=0.3 if vpls == 16 else 0.15)


def test_another_placement_has_walks_of_its_own(gl_context):
    """`captures` places VPLs anew in a drawn view: as if each had been drawn alone."""
    scene, view = colored_room(), room_view("spot", (16, 12))
    config = config_of("all", visibility="maps", parameters=FEW)
    runtime = Runtime(scene, context=gl_context)
    rotations = ((0.0, 0.0), (0.3, 0.7))
    together = runtime.captures(view, config, rotations)
    for rotation, captured in zip(rotations, together, strict=True):
        alone = runtime.capture(view, config, table_rotation=rotation)
        np.testing.assert_array_equal(captured.vpl_flux, alone.vpl_flux)
        np.testing.assert_array_equal(captured.indirect_irradiance, alone.indirect_irradiance)
    assert (together[0].vpl_position_world[128:] != together[1].vpl_position_world[128:]).any()


@pytest.mark.parametrize("bounces", [1, 2])
@pytest.mark.parametrize("count", [4095, 4096, 20000])
def test_many_vpls_of_glowing_walls_have_all_light_too(gl_context, count, bounces):
    """As many discs as there are samples would have none to be made of. To 3 % of what 512 VPLs give: their
    discs miss more of the corners."""
    scene, view = box(0.5, RADIANCE), view_inside()
    few = indirect(gl_context, scene, view, config_of(bounces))
    many = indirect(gl_context, scene, view, config_of(bounces, parameters=ArtistParameters(vpl_count=count)))
    np.testing.assert_allclose(many, few, rtol=3e-2)
