"""The comparison modes carry the same energy as the frame's own VPLs, each by its own way."""

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, quad, scene_of
from point_vpls import point_vpls

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.capture import read_image
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.scene.scene import Camera, Light, Scene, Texture
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View
from vpltune.renderer.techniques.gather_full_rsm import GatherFullRsm
from vpltune.renderer.techniques.ray_traced_instant_radiosity import RayTracedInstantRadiosity, traced_vpls
from vpltune.renderer.techniques.screen_space_only import ScreenSpaceOnly
from vpltune.renderer.techniques.vpls_readback import VplsReadback

PARAMETERS = point_vpls()
ROTATIONS = ((0.0, 0.0), (0.3, 0.7), (0.6, 0.1), (0.15, 0.45))


class Drawn:
    """A view of a scene, drawn, with what the comparison modes need of it."""

    def __init__(self, context, scene: Scene, view: View, rsm_resolution: int = 256):
        self.scene, self.view = scene, view
        self._config = TunedConfig(
            PARAMETERS,
            visibility="transmittance",
            quality=Quality(rsm_resolution=rsm_resolution),
            light=ONE_BOUNCE,
        )
        self._runtime = Runtime(scene, context=context)
        drawn = self._runtime.draw(view, self._config)
        self.frame, self.inputs = drawn.frame, drawn.inputs

    def main_path(self) -> np.ndarray:
        """The mean image over four rotations of the point table."""
        frames = self._runtime.captures(self.view, self._config, ROTATIONS)
        return np.mean([frame.vpl_irradiance for frame in frames], axis=0)


def irradiance(resources: Resources) -> np.ndarray:
    return read_image(resources, "vpl_irradiance")[..., :3]


def inside_room(light: str, size=(32, 24)) -> View:
    """From within the room, so that no silhouette is the image's edge."""
    camera = Camera(look_at(np.array([0.2, 0.1, 0.95]), np.array([0.0, -0.2, -1.0])), 1.0)
    return View(light, "fitted", size, camera, (ROOM_LIGHTS[light],))


@pytest.mark.parametrize("light", ["spot", "directional"])
def test_the_full_rsm_has_the_same_energy(gl_context, light):
    """Within 2 %: four rotations of 1,024 VPLs are uncertain by about one percent.

    Texels are far smaller than VPLs, so that the full RSM is hardly softened. The VPLs' own softening takes
    less than 1 % at α = 0.5.
    """
    drawn = Drawn(gl_context, colored_room(), inside_room(light))
    expected = drawn.main_path().mean()
    image = irradiance(GatherFullRsm(drawn.frame, stride=2).draw(drawn.inputs))
    assert image.mean() == pytest.approx(expected, rel=0.02)


def test_the_stride_changes_no_energy(gl_context):
    """Texels taken singly or four by four: within 2 %, for larger VPLs are softened more."""
    drawn = Drawn(gl_context, colored_room(), inside_room("spot", (16, 12)), rsm_resolution=128)
    means = []
    for stride in (1, 4):
        means.append(irradiance(GatherFullRsm(drawn.frame, stride).draw(drawn.inputs)).mean())
    assert means[0] == pytest.approx(means[1], rel=0.02)


@pytest.mark.parametrize("light", ["spot", "wide_spot", "point", "directional"])
def test_read_back_vpls_have_the_same_energy(gl_context, light):
    """Within 5 %: of 2,048 Poisson-disc points many fall on dark texels, and few carry the light."""
    drawn = Drawn(gl_context, colored_room(), inside_room(light))
    expected = drawn.main_path()
    readback = VplsReadback(drawn.frame, 2048)
    vpls = readback.place(readback.read(), drawn.inputs.records)
    image = irradiance(readback.draw(drawn.inputs, vpls))
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=0.05)


def test_read_back_texels_are_the_gpus(gl_context):
    """Reading back the RSM and drawing VPLs on the GPU agree in total flux: each a sum over the same texels.

    Within 2 %, what 2,048 uniform points leave uncertain of a spot's footprint.
    """
    drawn = Drawn(gl_context, colored_room(), inside_room("spot"))
    vpls = np.frombuffer(drawn.frame.resources.read("virtual_point_lights"), np.float32)
    readback = VplsReadback(drawn.frame, 2048)
    placed = readback.place(readback.read(), drawn.inputs.records)
    np.testing.assert_allclose(
        placed["flux"].sum(axis=0), vpls.reshape(-1, 12)[:, 8:11].sum(axis=0), rtol=0.02
    )


@pytest.mark.parametrize("light", ["spot", "wide_spot", "point", "directional"])
def test_traced_rays_have_the_same_energy(gl_context, light):
    """Within 5 %: rays are uniform over the light's whole cone or beam, and many miss the room."""
    drawn = Drawn(gl_context, colored_room(), inside_room(light))
    expected = drawn.main_path()
    traced = RayTracedInstantRadiosity(drawn.frame, drawn.scene, 2048)
    image = irradiance(traced.draw(drawn.view, drawn.inputs))
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=0.05)


def test_traced_rays_take_the_texture(gl_context):
    """A floor of one texture, half black and half white, gives back half of the light that it gets."""
    floor = quad((-10, 0, -10), (0, 0, 20), (20, 0, 0))
    texels = np.zeros((1, 2, 3), np.uint8)
    texels[:, 1] = 255
    plain = scene_of([floor], [(1.0, 1.0, 1.0)])
    material = type(plain.materials[0])("textured", np.ones(3, np.float32), 0)
    uv = np.array([[0, 0], [0, 1], [1, 1], [1, 0]], np.float32)
    mesh = type(floor)(floor.name, floor.positions, floor.normals, uv, floor.colors, floor.triangles, 0)
    scene = Scene("half", (mesh,), plain.instances, (material,), (Texture("t", texels),))
    light = Light("spot", np.ones(3), np.array([0.0, 2.0, 0.0]), np.array([0.0, -1.0, 0.0]), 0.5, 0.6)
    full = traced_vpls(plain, (light,), 4096)["flux"].sum(axis=0)
    half = traced_vpls(scene, (light,), 4096)["flux"].sum(axis=0)
    np.testing.assert_allclose(half, 0.5 * full, rtol=0.01)


def test_the_screen_holds_all_light_where_all_is_seen(gl_context):
    """A lit floor and a wall, both in the image: within 3 % of the VPLs' energy on the wall.

    The spot's cone is soft, so that its rim falls between pixels without harm.
    """
    floor = quad((-3, 0, 0), (0, 0, 4), (6, 0, 0), 0, "floor")
    wall = quad((-3, 0, 0), (6, 0, 0), (0, 4, 0), 0, "wall")
    light = Light("spot", np.full(3, 8.0), np.array([0.0, 2.0, 1.5]), np.array([0.0, -1.0, 0.0]), 0.1, 0.5)
    camera = Camera(look_at(np.array([0.0, 3.0, 8.0]), np.array([0.0, 1.2, 0.0])), 0.8)
    view = View("corner", "fitted", (96, 72), camera, (light,))
    drawn = Drawn(gl_context, scene_of([floor, wall], [(0.6, 0.6, 0.6)]), view)
    expected = drawn.main_path()
    image = irradiance(ScreenSpaceOnly(drawn.frame, stride=1).draw(drawn.inputs))
    assert image.mean() == pytest.approx(expected.mean(), rel=0.03)


def test_the_screen_knows_nothing_of_what_it_does_not_see(gl_context):
    """A camera that looks away from the lit floor gets nothing from it, where VPLs do."""
    view = View(
        "up",
        "fitted",
        (16, 12),
        Camera(look_at(np.array([0.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.01])), 0.5),
        (ROOM_LIGHTS["spot"],),
    )
    drawn = Drawn(gl_context, colored_room(), view)
    assert drawn.main_path().mean() > 0.0
    assert not irradiance(ScreenSpaceOnly(drawn.frame).draw(drawn.inputs)).any()


def test_a_technique_leaves_the_frame_as_it_is(gl_context):
    """VPLs, parameters and irradiance of its own lie beside the frame's."""
    drawn = Drawn(gl_context, colored_room(), inside_room("spot", (16, 12)), rsm_resolution=64)
    names = ("virtual_point_lights", "artist_parameters")
    before = [drawn.frame.resources.read(name) for name in names]
    image = irradiance(drawn.frame.resources)
    readback = VplsReadback(drawn.frame, 64)
    for resources in (
        GatherFullRsm(drawn.frame, stride=4).draw(drawn.inputs),
        ScreenSpaceOnly(drawn.frame).draw(drawn.inputs),
        RayTracedInstantRadiosity(drawn.frame, drawn.scene, 64).draw(drawn.view, drawn.inputs),
        readback.draw(drawn.inputs, readback.place(readback.read(), drawn.inputs.records)),
    ):
        assert irradiance(resources).any()
        assert not np.array_equal(irradiance(resources), image)
    np.testing.assert_array_equal(irradiance(drawn.frame.resources), image)
    assert [drawn.frame.resources.read(name) for name in names] == before
