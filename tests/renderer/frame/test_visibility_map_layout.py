"""Visibility maps of every size that can be asked for, and with too little room for finer texels."""

import numpy as np
import pytest
from built_scenes import colored_room, room_view

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import MAP_REFINEMENTS, Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame import visibility_map_layout
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.visibility_map_layout import NO_MAPS, TEXEL_BYTES, VisibilityMapLayout
from vpltune.renderer.scene.views import View

VIEW = room_view("spot", (32, 24))


def room_capture(
    gl_context, size: int, refinement: int, vpl_count: int = 64, view: View = VIEW
) -> CapturedFrame:
    """The room's VPLs and light, where OpenGL has nothing to say against it."""
    quality = Quality(map_size=size, map_refinement=refinement, rsm_resolution=256)
    parameters = ArtistParameters(vpl_count=vpl_count)
    config = TunedConfig(parameters, visibility="maps", quality=quality, light=ONE_BOUNCE)
    return Runtime(colored_room(), context=gl_context).capture(view, config)


def room_light(gl_context, size: int, refinement: int, vpl_count: int = 64) -> np.ndarray:
    light = room_capture(gl_context, size, refinement, vpl_count).vpl_irradiance
    assert np.isfinite(light).all()
    return light


def relative_rms(value: np.ndarray, expected: np.ndarray) -> float:
    return float(np.sqrt(np.mean((value - expected) ** 2) / np.mean(expected**2)))


@pytest.fixture(scope="module")
def finest(gl_context) -> np.ndarray:
    return room_light(gl_context, 64, 8)


@pytest.mark.parametrize("refinement", MAP_REFINEMENTS)
@pytest.mark.parametrize("size", [4, 64])
def test_smallest_and_largest_maps_draw_the_room(gl_context, finest, size, refinement):
    """Against 64² maps refined by 8: 1 % where they are as large, 30 % where 16 texels see the hemisphere."""
    bound = 0.3 if size == 4 else 0.01
    assert relative_rms(room_light(gl_context, size, refinement), finest) < bound


@pytest.mark.parametrize("refinement", MAP_REFINEMENTS)
def test_one_vpl_has_a_map(gl_context, refinement):
    """The one VPL lights most of the room, and less of it than without occluders."""
    config = TunedConfig(
        ArtistParameters(vpl_count=1),
        visibility="transmittance",
        quality=Quality(rsm_resolution=256),
        light=ONE_BOUNCE,
    )
    free = Runtime(colored_room(), context=gl_context).capture(VIEW, config)
    seen = room_light(gl_context, 24, refinement, vpl_count=1)
    assert 0.5 < seen.mean() / free.vpl_irradiance.mean() < 1.0


def test_in_the_dark_no_vpl_sees_anything(gl_context):
    """Without a light, and so without L, no ray is cast, no silhouette found and no NaN made."""
    config = TunedConfig(ArtistParameters(vpl_count=3), visibility="maps")
    captured = Runtime(colored_room(), context=gl_context).capture(room_view(None, (16, 12)), config)
    assert not captured.vpl_irradiance.any()
    assert (captured.visibility_maps.block == -1).all()
    assert np.isfinite(captured.visibility_maps.distance).all()


def test_the_most_vpls_have_maps(gl_context):
    """More workgroups than a driver need take along one side: the last maps are cast as all others are."""
    most = int(parameter_spec("vpl_count").high)
    distance = room_capture(gl_context, 4, 1, most, room_view("spot", (8, 6))).visibility_maps.distance
    assert distance.shape == (most, 4, 4)
    assert (distance > 0.0).all()


def test_silhouettes_that_find_no_room_stay_coarse(gl_context, monkeypatch):
    """With room for a 400th of the texels, of which more are silhouettes: between no finer texels and all."""
    unrefined, refined = (room_light(gl_context, 12, refinement) for refinement in (1, 4))
    all_bytes = 64 * 12**2 * 4**2 * TEXEL_BYTES
    monkeypatch.setattr(visibility_map_layout, "_MOST_DETAIL_BYTES", all_bytes // 400)
    crowded = room_light(gl_context, 12, 4)
    assert 0.0 < relative_rms(crowded, refined) < 1.1 * relative_rms(unrefined, refined)


@pytest.mark.parametrize("refinement", MAP_REFINEMENTS[1:])
@pytest.mark.parametrize(("vpl_count", "size"), [(1, 4), (1024, 24), (65536, 64)])
def test_room_for_finer_texels_fits_a_storage_buffer(vpl_count, size, refinement):
    """2²⁷ bytes are what drivers take in one at least; and there is room for some."""
    blocks = VisibilityMapLayout(size, refinement).blocks(vpl_count)
    assert 0 < blocks * refinement**2 * TEXEL_BYTES <= 1 << 27


def test_the_layout_is_what_the_config_asks_for():
    config = TunedConfig(quality=Quality(map_size=12, map_refinement=2))
    assert VisibilityMapLayout.of(config) == VisibilityMapLayout(12, 2)
    assert VisibilityMapLayout.of(TunedConfig()) == VisibilityMapLayout(32, 4)
    assert VisibilityMapLayout.of(config.seen_by("transmittance")) == NO_MAPS


def test_no_maps_are_captured_where_none_are_asked_for(gl_context):
    runtime = Runtime(colored_room(), context=gl_context)
    config = TunedConfig(ArtistParameters(vpl_count=16), quality=Quality(map_size=4, rsm_resolution=64))
    assert runtime.capture(VIEW, config.seen_by("transmittance")).visibility_maps is None
    assert runtime.capture(VIEW, config, maps=False).visibility_maps is None
    assert runtime.capture(VIEW, config).visibility_maps is not None
