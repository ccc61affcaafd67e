"""Environment maps of Mitsuba scenes: their size is checked by their header, before anything is decoded."""

import struct

import numpy as np
import OpenEXR
import pytest
from reading_cost import MITSUBA, check_cost

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.mitsuba_import import read_mitsuba

SCENE = (
    '<scene><shape type="cube"/>'
    '<emitter type="envmap"><string name="filename" value="scene.exr"/>{}</emitter></scene>'
)
WINDOW = b"dataWindow\0box2i\0" + struct.pack("<i", 16)


def scene_with(folder, channels, inner=""):
    """A scene with an environment of these channels; the path of its XML."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(folder / "scene.exr"))
    path = folder / "scene.xml"
    path.write_text(SCENE.format(inner))
    return path


@pytest.mark.parametrize(
    ("size", "said"),
    [
        ((16_385, 8), "an image must be at most 16384 texels on a side and 67,108,864 in all, got 16385 × 8"),
        ((16_000, 16_000), "67,108,864 in all, got 16000 × 16000"),
        ((1_000_000_000, 1_000_000_000), "67,108,864 in all, got 1000000000 × 1000000000"),
        # Within the limits of an image, with three channels of four bytes.
        ((8192, 8192), "an environment map must take at most 512 MiB once decoded, and this needs 768 MiB"),
    ],
)
def test_a_header_that_says_too_much_is_refused(tmp_path, size, said):
    path = scene_with(tmp_path, {"RGB": np.ones((8, 16, 3), np.float32)})
    image = tmp_path / "scene.exr"
    content = bytearray(image.read_bytes())
    struct.pack_into("<4i", content, content.index(WINDOW) + len(WINDOW), 0, 0, size[0] - 1, size[1] - 1)
    image.write_bytes(content)
    assert said in check_cost(path, MITSUBA)
    with pytest.raises(InputError, match=r"line 1: emitter 'envmap': 'scene\.exr': "):
        read_mitsuba(path)


@pytest.mark.slow  # on a loaded machine, its processor time swells beyond the bound
def test_a_large_environment_stays_within_the_bounds_of_reading(tmp_path):
    """The usual 8,192 × 4,096 texels, in half precision. They took 2 GiB."""
    pixels = np.zeros((4096, 8192, 3), np.float16)
    pixels[500:510, 100:130] = 1000.0
    assert check_cost(scene_with(tmp_path, {"RGB": pixels}), MITSUBA) == ""


@pytest.mark.parametrize("size", [(5, 7), (24, 48), (31, 100)])
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_texels_are_kept_and_scaled(tmp_path, size, dtype):
    pixels = np.random.default_rng(1).uniform(0.0, 9.0, (*size, 3)).astype(dtype)
    scene = read_mitsuba(scene_with(tmp_path, {"RGB": pixels}, '<float name="scale" value="3"/>'))
    np.testing.assert_allclose(scene.environment.radiance, 3.0 * pixels.astype(np.float32), rtol=1e-6)
    assert scene.lights == ()


@pytest.mark.parametrize("scale", ["-1", "1e30"])
def test_the_scale_is_bounded(tmp_path, scale):
    pixels = np.ones((2, 4, 3), np.float32)
    with pytest.raises(InputError, match=r"emitter 'envmap': 'scene\.exr': .*must be"):
        read_mitsuba(scene_with(tmp_path, {"RGB": pixels}, f'<float name="scale" value="{scale}"/>'))


@pytest.mark.parametrize("value", [-1.0, np.inf, np.nan])
def test_radiance_must_be_finite_and_positive(tmp_path, value):
    pixels = np.ones((8, 16, 3), np.float32)
    pixels[3, 4, 1] = value
    with pytest.raises(InputError, match="radiance must be finite and ≥ 0"):
        read_mitsuba(scene_with(tmp_path, {"RGB": pixels}))


def test_other_channels_are_refused(tmp_path):
    with pytest.raises(InputError, match="must have channels R, G and B, got Y"):
        read_mitsuba(scene_with(tmp_path, {"Y": np.ones((8, 16), np.float32)}))
