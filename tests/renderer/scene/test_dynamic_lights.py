"""Dynamic lights: closed forms, three passes that must agree, and the number of GL calls per frame."""

from dataclasses import replace

import moderngl
import numpy as np
import pytest
from built_scenes import colored_room, quad, room_view, scene_of

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.capture import read_image
from vpltune.renderer.frame.passes.light_volumes import (
    CONE_DEFINES,
    LightVolumesPass,
    cone_proxy,
    sphere_proxy,
)
from vpltune.renderer.frame.passes.tiled_lights import TILE_BATCH, TiledLightsPass
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.dynamic_lights import (
    DYNAMIC_LIGHT_DTYPE,
    MIN_DISTANCE,
    DynamicLights,
    point_lights,
    scaled_records,
    spot_lights,
)
from vpltune.renderer.scene.scene import Camera, scaled
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, scaled_view
from vpltune.renderer.techniques.light_per_draw import LightPerDrawPass

WAYS = (LightPerDrawPass, LightVolumesPass, TiledLightsPass)
CONFIG = TunedConfig(ArtistParameters(vpl_count=16), quality=Quality(rsm_resolution=128), light=ONE_BOUNCE)
SIZE = (136, 72)
"""Not a whole number of tiles, and more than one cell."""


class Lighting:
    """A G-buffer and the three passes that can light it."""

    def __init__(self, context, scene, view):
        config = TunedConfig(
            ArtistParameters(vpl_count=1), quality=Quality(rsm_resolution=64), light=ONE_BOUNCE
        )
        drawn = Runtime(scene, context=context).draw(view, config)
        self.captured, self.inputs = drawn.capture(), drawn.inputs
        self.resources = drawn.frame.resources.child()
        self.passes = {way.__name__: way(self.resources) for way in WAYS}

    def irradiance(self, records, way="TiledLightsPass"):
        lights = DynamicLights(records)
        self.resources["dynamic_lights"] = self.resources.context.buffer(lights.numbers)
        self.passes[way].draw(replace(self.inputs, dynamic_lights=lights))
        stored = read_image(self.resources, self.passes[way].accumulation)[..., :3]
        return stored.astype(np.float32) * np.float32(lights.accumulation_unit)


@pytest.fixture(scope="module")
def room(gl_context):
    """The coloured room, seen from just inside its open side."""
    camera = Camera(look_at(np.array([0.1, 0.05, 0.9]), np.array([-0.1, -0.1, -1.0])), 1.2)
    return Lighting(gl_context, colored_room(), View("room", "fitted", SIZE, camera, ()))


def expected_irradiance(captured, light) -> np.ndarray:
    """The formula in renderer/scene/dynamic_lights.py, in double precision."""
    to_light = light["position_world"].astype(np.float64) - captured.position_world
    square = (to_light**2).sum(axis=-1)
    towards = to_light / np.sqrt(square)[..., None]
    range_square = np.square(np.float64(light["range"]))
    window = np.clip(1.0 - (square / range_square) ** 2, 0.0, 1.0)
    along = -towards @ light["direction_world"].astype(np.float64)
    ramp = np.clip((along - light["cos_outer"]) * light["cone_scale"], 0.0, 1.0)
    cosine = np.maximum((captured.normal_world * towards).sum(axis=-1), 0.0)
    form = cosine * ramp**2 * window / np.maximum(square, MIN_DISTANCE**2 * range_square)
    return light["intensity"] * np.where(captured.valid, form, 0.0)[..., None]


def random_lights(count, seed, reach=0.4):
    """Half points and half spots, in and around the room. Some are behind the camera."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-1.3, 1.3, (count, 3))
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    half = count // 2
    parts = [
        point_lights(positions[:half], rng.uniform(0.1, 1.0, (half, 3)), rng.uniform(0.2, 1.0, half) * reach),
        spot_lights(positions[half:], np.full(3, 0.5), reach, directions[half:], 0.2, 0.6),
    ]
    return np.concatenate(parts)[rng.permutation(count)]


def spot(position, direction, reach, inner=0.2, outer=0.6):
    direction = np.array([direction], np.float64)
    direction /= np.linalg.norm(direction)
    return spot_lights(
        np.array([position], np.float64), np.array([1.0, 2.0, 3.0]), reach, direction, inner, outer
    )


SINGLE_LIGHTS = {
    "point": point_lights(np.array([[0.2, 0.3, -0.4]]), np.array([1.0, 2.0, 3.0]), 1.0),
    "point far beyond the room": point_lights(np.array([[0.0, 0.9, 0.2]]), np.ones(3), 50.0),
    "around the camera": point_lights(np.array([[0.1, 0.0, 0.8]]), np.ones(3), 1.5),
    "behind the camera": point_lights(np.array([[0.0, 0.0, 1.4]]), np.ones(3), 1.8),
    "spot": spot((0.0, 0.8, -0.3), (0.1, -1.0, -0.1), 2.5),
    "narrow spot": spot((0.0, 0.8, -0.3), (0.1, -1.0, -0.1), 2.5, 0.01, 0.05),
    "hemisphere": spot((0.0, 0.8, -0.3), (0.3, -1.0, 0.2), 1.7, 1.0, np.pi / 2),
    "spot from behind the camera": spot((0.0, 0.1, 1.5), (0.0, 0.0, -1.0), 4.0),
    "spot that looks at the camera": spot((0.0, 0.0, -0.9), (0.0, 0.0, 1.0), 3.0, 0.3, 1.2),
    "almost on the floor": point_lights(np.array([[0.3, -0.997, -0.3]]), np.ones(3), 2.0),
}


@pytest.mark.parametrize("way", [way.__name__ for way in WAYS])
@pytest.mark.parametrize("name", SINGLE_LIGHTS)
def test_one_light_is_its_closed_form(room, name, way):
    """To a relative 1e-3: half floats round to 5e-4, and all else is single precision.

    The absolute tolerance is for values near zero, where half floats have steps of fixed size. Near the
    floor, the distance to the light is a difference of positions that is accurate to 1e-4.
    """
    records = SINGLE_LIGHTS[name]
    expected = expected_irradiance(room.captured, records[0])
    assert expected.max() > 0.0
    np.testing.assert_allclose(
        room.irradiance(records, way), expected, rtol=1e-3, atol=2e-5 * float(expected.max())
    )


def test_three_ways_give_one_image(room):
    """400 lights of both kinds give the same image to 1e-3, which is one rounding of half floats."""
    records = random_lights(400, seed=1)
    images = [room.irradiance(records, way.__name__) for way in WAYS]
    assert (images[0] > 0.0).any(axis=-1).mean() > 0.4
    for image in images[1:]:
        np.testing.assert_allclose(image, images[0], rtol=1e-3, atol=1e-5 * float(images[0].max()))


def test_more_lights_than_a_batch_holds(room):
    """A tile processes its lights in batches. No light is lost, wherever it is in the list."""
    count = 2 * TILE_BATCH + 77
    records = random_lights(count, seed=2, reach=0.08)
    tiles, volumes = (room.irradiance(records, way) for way in ("TiledLightsPass", "LightVolumesPass"))
    np.testing.assert_allclose(tiles, volumes, rtol=1e-3, atol=1e-5 * float(volumes.max()))
    far = point_lights(np.full((count, 3), 50.0), np.full(3, 0.01), 0.1)
    bright = SINGLE_LIGHTS["point"]
    for place in (0, TILE_BATCH - 1, TILE_BATCH, count - 1):
        records = far.copy()
        records[place] = bright[0]
        np.testing.assert_allclose(
            room.irradiance(records), expected_irradiance(room.captured, bright[0]), rtol=1e-3, atol=1e-4
        )


def test_every_light_in_one_place(room):
    """All lights reach the same tiles. Nothing overflows, and every light contributes."""
    one = SINGLE_LIGHTS["point"]
    np.testing.assert_allclose(
        room.irradiance(np.repeat(one, 1000)), 1000.0 * room.irradiance(one), rtol=2e-3, atol=1e-2
    )


@pytest.mark.parametrize("way", [way.__name__ for way in WAYS])
def test_energy_adds_up(room, way):
    """Two sets of lights together give the sum of both. Doubled intensity gives doubled irradiance."""
    first, second = random_lights(40, seed=3), random_lights(40, seed=4)
    both = room.irradiance(np.concatenate([first, second]), way)
    separate = room.irradiance(first, way) + room.irradiance(second, way)
    np.testing.assert_allclose(both, separate, rtol=1.5e-3, atol=1e-5 * float(both.max()))
    twice = first.copy()
    twice["intensity"] *= 2.0
    np.testing.assert_array_equal(room.irradiance(twice, way), 2.0 * room.irradiance(first, way))


@pytest.mark.parametrize("way", [way.__name__ for way in WAYS])
def test_nothing_beyond_the_range(room, way):
    """A light with no surface within its range gives exactly zero."""
    records = point_lights(np.array([[0.0, 0.0, 0.0]]), np.ones(3), 0.2)
    nearest = np.linalg.norm(room.captured.position_world[room.captured.valid], axis=1).min()
    assert nearest > 0.2
    assert not room.irradiance(records, way).any()


@pytest.mark.parametrize("factor", [0.01, 0.1, 10.0, 100.0])
@pytest.mark.parametrize("path", ["volumes", "tiles"])
def test_scale_changes_nothing(gl_context, path, factor):
    """Scene, camera and lights scaled together give the same image, to 1e-3 relative RMSE."""
    view, records = room_view("spot"), random_lights(200, seed=5)
    images = []
    for scale in (1.0, factor):
        runtime = Runtime(scaled(colored_room(), scale), RuntimeOptions(light_path=path), context=gl_context)
        lights = DynamicLights(scaled_records(records, scale))
        images.append(runtime.render_radiance(scaled_view(view, scale), CONFIG, lights=lights))
    error = np.sqrt(np.mean((images[1] - images[0]) ** 2) / np.mean(images[0] ** 2))
    assert error < 1e-3


@pytest.mark.parametrize("path", ["auto", "volumes", "tiles"])
def test_the_frame_adds_them_to_the_direct_light(gl_context, path):
    """Direct irradiance grows by what the lights give. Indirect irradiance does not change."""
    runtime = Runtime(colored_room(), RuntimeOptions(light_path=path), context=gl_context)
    view, records = room_view("spot"), random_lights(50, seed=6)
    without = runtime.capture(view, CONFIG)
    with_lights = runtime.capture(view, CONFIG, lights=DynamicLights(records))
    expected = sum(expected_irradiance(without, record) for record in records)
    np.testing.assert_allclose(
        with_lights.direct_irradiance - without.direct_irradiance,
        expected,
        rtol=1e-3,
        atol=1e-3 * float(without.direct_irradiance.max()),
    )
    np.testing.assert_array_equal(with_lights.indirect_irradiance, without.indirect_irradiance)
    dark = runtime.capture(view, CONFIG, lights=DynamicLights(records[:0]))
    np.testing.assert_array_equal(dark.direct_irradiance, without.direct_irradiance)


def test_auto_measures_both_ways_once(gl_context):
    """The faster of the two timed passes is chosen and kept, so frames repeat bitwise."""
    runtime = Runtime(colored_room(), context=gl_context)
    view, lights = room_view("spot"), DynamicLights(random_lights(60, seed=7))
    first = runtime.capture(view, CONFIG, lights=lights).direct_irradiance
    drawn = runtime.draw(view, CONFIG, lights=lights)
    pre_pass = drawn.frame.light_pre_pass
    assert set(pre_pass.milliseconds) == {6}
    measured = pre_pass.milliseconds[6]
    assert set(measured) == {"volumes", "tiles"}
    assert min(measured.values()) > 0.0
    assert pre_pass.path(drawn.inputs) == min(measured, key=measured.get)
    np.testing.assert_array_equal(runtime.capture(view, CONFIG, lights=lights).direct_irradiance, first)


@pytest.mark.parametrize("path", ["volumes", "tiles"])
def test_a_thousand_lights_take_few_calls(gl_context, monkeypatch, path):
    """Lights add at most four draw or dispatch calls, and one buffer write, to a frame."""
    calls = {"draw": 0, "write": 0}

    def counted(owner, name, kind):
        original = getattr(owner, name)

        def call(*arguments, **keywords):
            calls[kind] += 1
            return original(*arguments, **keywords)

        monkeypatch.setattr(owner, name, call)

    runtime = Runtime(colored_room(), RuntimeOptions(light_path=path), context=gl_context)
    view, lights = room_view("spot"), DynamicLights(random_lights(1000, seed=8))
    runtime.draw(view, CONFIG, lights=lights)
    for name in ("render", "render_indirect"):
        counted(moderngl.VertexArray, name, "draw")
    for name in ("run", "run_indirect"):
        counted(moderngl.ComputeShader, name, "draw")
    counted(moderngl.Buffer, "write", "write")
    runtime.draw(view, CONFIG)
    plain = dict(calls)
    assert plain["draw"] > 4
    runtime.draw(view, CONFIG, lights=lights)
    assert 1 <= calls["draw"] - 2 * plain["draw"] <= 4
    assert calls["write"] - 2 * plain["write"] == 1


def test_a_sphere_proxy_holds_the_sphere():
    """The mesh is closed, winds outwards, and every face is at least 1 from the centre."""
    vertices, triangles = sphere_proxy()
    assert len(triangles) == 80
    assert_closed_around(vertices[triangles], np.zeros(3), triangles)
    assert face_distances(vertices[triangles]).min() == pytest.approx(1.0)
    assert np.linalg.norm(vertices, axis=1).max() < 1.2


@pytest.mark.parametrize("outer", [0.01, 0.3, 0.8, 1.2, 1.5, np.pi / 2])
def test_a_cone_proxy_holds_the_cone(outer):
    """The mesh that light_volumes.vert builds is convex and contains the spherical sector of the cone."""
    shares, triangles = cone_proxy()
    angle = np.arctan2(np.sin(outer), np.cos(outer) * CONE_DEFINES["AZIMUTH_COSINE"])
    polar = np.maximum(shares[:, 0], 0.0) * angle
    rim = np.column_stack([np.sin(polar) * shares[:, 1], np.sin(polar) * shares[:, 2], np.cos(polar)])
    vertices = rim * np.where(shares[:, :1] < 0.0, 0.0, CONE_DEFINES["CIRCUMSCRIBED"])
    inside = np.array([0.0, 0.0, 0.5])
    assert_closed_around(vertices[triangles], inside, triangles)
    rng = np.random.default_rng(0)
    theta, phi = outer * np.sqrt(rng.random(5000)), 2.0 * np.pi * rng.random(5000)
    theta[:1000] = outer
    sector = np.column_stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # A point behind the planes of all faces is inside a convex body. 1e-9: rounding.
    for points in (sector, vertices):
        heights = points @ normals.T - (normals * corners[:, 0]).sum(axis=1)
        assert heights.max() < 1e-9


def face_distances(corners):
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return (normals * corners[:, 0]).sum(axis=1) / np.linalg.norm(normals, axis=1)


def assert_closed_around(corners, inside, triangles):
    """Each edge occurs once in either direction, and every face points away from `inside`."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normals * (corners[:, 0] - inside)).sum(axis=1) > 0.0).all()
    edges = [(int(t[i]), int(t[(i + 1) % 3])) for t in triangles for i in range(3)]
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges)


def test_points_come_first_and_order_is_kept():
    records = random_lights(20, seed=9)
    lights = DynamicLights(records)
    assert (lights.point_count, lights.spot_count, len(lights)) == (10, 10, 20)
    ordered = lights.numbers.view(DYNAMIC_LIGHT_DTYPE).ravel()
    points = records[records["cos_outer"] < -1.0]
    np.testing.assert_array_equal(ordered[:10], points)
    kept = ordered.copy()
    lights.update(kept)
    assert np.shares_memory(lights.numbers, kept)


def test_the_unit_follows_the_lights_not_their_scale():
    records = random_lights(20, seed=10)
    unit = DynamicLights(records).accumulation_unit
    assert DynamicLights(scaled_records(records, 0.25)).accumulation_unit == unit
    records["intensity"] *= 1024.0
    assert DynamicLights(records).accumulation_unit == 1024.0 * unit


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("range", 0.0, "every range must be positive, got 0.0"),
        ("intensity", -1.0, "every intensity must be ≥ 0, got -1.0"),
        ("position_world", np.nan, "every number must be finite"),
    ],
)
def test_lights_that_cannot_be_are_refused(field, value, message):
    records = random_lights(4, seed=11)
    records[field][2] = value
    with pytest.raises(ValueError, match=message):
        DynamicLights(records)


def test_records_of_another_kind_are_refused():
    with pytest.raises(ValueError, match="must be .n. of DYNAMIC_LIGHT_DTYPE, got .3, 12. float32"):
        DynamicLights(np.zeros((3, 12), np.float32))
    with pytest.raises(ValueError, match="spot_lights: cone angles must satisfy .*, got 0.5 and 0.4"):
        spot((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0, 0.5, 0.4)


def test_lights_that_touch_a_floor_stay_finite(gl_context):
    """A light on a surface is bright but finite, because MIN_DISTANCE bounds it."""
    floor = scene_of([quad((-1, 0, -1), (0, 0, 2), (2, 0, 0))], [(0.5, 0.5, 0.5)])
    camera = Camera(look_at(np.array([0.0, 2.0, 0.0]), np.zeros(3)), 0.9)
    for path in ("volumes", "tiles"):
        runtime = Runtime(floor, RuntimeOptions(light_path=path), context=gl_context)
        view = View("floor", "fitted", (33, 33), camera, ())
        lights = DynamicLights(point_lights(np.repeat([[0.0, 1e-5, 0.0]], 50, axis=0), np.full(3, 1e6), 2.0))
        assert np.isfinite(runtime.render_radiance(view, CONFIG, lights=lights)).all()
