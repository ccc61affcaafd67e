"""Several shadow-casting lights at once: light adds up, and VPLs are shared out by flux."""

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view
from point_vpls import point_vpls

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.views import View

PAIRS = (("spot", "point"), ("point", "directional"), ("wide_spot", "spot"))
ALL_KINDS = ("spot", "point", "directional")


@pytest.fixture(scope="module")
def captured(gl_context):
    """Captures of the room by names of lights; all with one RSM resolution, so that shadows are the same.

    Without visibility maps, which know nothing of lights: those of 4,096 VPLs take long.
    """
    config = TunedConfig(
        point_vpls(vpl_count=4096),
        visibility="transmittance",
        quality=Quality(rsm_resolution=256),
        light=ONE_BOUNCE,
    )
    runtime = Runtime(colored_room(), context=gl_context)
    made = {}

    def capture(*names):
        if names not in made:
            view = room_view(names[0], (48, 36))
            lights = tuple(ROOM_LIGHTS[name] for name in names)
            view = View("lights", "fitted", view.size, view.camera, lights)
            made[names] = runtime.capture(view, config)
        return made[names]

    return capture


@pytest.mark.parametrize("names", [*PAIRS, ALL_KINDS])
def test_direct_light_is_the_sum(captured, names):
    """To float32: each light has its own faces of the atlas, wherever in it they lie."""
    total = sum(captured(name).direct_irradiance.astype(np.float64) for name in names)
    np.testing.assert_allclose(captured(*names).direct_irradiance, total, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("names", [*PAIRS, ALL_KINDS])
def test_indirect_light_is_the_sum(captured, names):
    """The mean to 1 %, and relative RMSE below 8 %: the VPLs are shared, each light has fewer than alone."""
    total = sum(captured(name).indirect_irradiance.astype(np.float64) for name in names)
    together = captured(*names).indirect_irradiance
    assert together.mean() == pytest.approx(total.mean(), rel=1e-2)
    assert np.sqrt(np.mean((together - total) ** 2) / np.mean(total**2)) < 0.08


@pytest.mark.parametrize("names", [*PAIRS, ALL_KINDS])
def test_flux_is_the_sum(captured, names):
    """Exactly, to float32 sums: with chances in proportion to flux every draw has the same."""
    total = sum(captured(name).vpl_flux.mean(axis=1).sum() for name in names)
    np.testing.assert_allclose(captured(*names).vpl_flux.mean(axis=1).sum(), total, rtol=1e-4)


def test_vpls_are_shared_out_by_flux(captured):
    """Each of two lights gets VPLs in proportion to its flux, to a few of 4,096: the table is stratified.

    The directional light comes from outside, where no point light's VPL is: on faces that look outwards.
    """
    together = captured("point", "directional")
    position, normal = together.vpl_position_world, together.vpl_normal_world
    from_outside = np.sum(position * normal, axis=1) > 0.5
    # What the sun sends through the open side lands inside, like the point light's.
    alone = captured("directional")
    sun_outside = np.sum(alone.vpl_position_world * alone.vpl_normal_world, axis=1) > 0.5
    flux = {name: captured(name).vpl_flux.mean(axis=1).sum() for name in ("point", "directional")}
    share = flux["directional"] / sum(flux.values()) * sun_outside.mean()
    assert from_outside.mean() == pytest.approx(share, abs=0.01)
