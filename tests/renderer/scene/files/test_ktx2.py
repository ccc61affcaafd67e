"""KTX2 textures (KHR_texture_basisu): blocks of known colours, a plain image first, and broken files."""

import base64
import random
import re
import struct

import numpy as np
import pytest
from PIL import Image
from reading_cost import check_cost

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import ktx2_images, read_scene
from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.image_texels import GLTF_FORMATS, ImageDecoder
from vpltune.renderer.scene.files.ktx2_images import Ktx2Decoder
from vpltune.renderer.scene.files.limited_decoder import LimitedDecoder
from vpltune.renderer.scene.files.limits import MAX_IMAGE_SIDE

RED, GREEN, BLUE, GREY = (200, 40, 40), (40, 200, 40), (40, 40, 200), (240, 240, 240)
# 16 × 12 texels, rows of blocks from the top.
BLOCKS = [[RED] * 4, [GREEN] * 4, [BLUE, BLUE, BLUE, GREY]]
TEXELS = np.array(BLOCKS, np.uint8).repeat(4, axis=0).repeat(4, axis=1)
UV = np.array([[0, 0], [1, 0], [0, 1]], np.float32)
# KTX 2.0, section 3.10: a descriptor's one sample, of 128 bits.
SAMPLE = (0, 127, 0, 0, 0, 0xFFFFFFFF)
# The same image in ETC1S, as the Basis Universal encoder writes it: 340 bytes.
ETC1S = base64.b64decode(
    "q0tUWCAyMLsNChoKAAAAAAEAAAAQAAAADAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAACwAAACUAAAAJAAAALgAAAAAAAAA"
    "lwAAAAAAAABPAQAAAAAAAAUAAAAAAAAAAAAAAAAAAAAsAAAAAAAAAAIAKACjAQIAAwMAAAgAAAAAAAAAAAA/AAAAAAAAAAAA"
    "/////x8AAABLVFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAAAQAAwAyAAAADQAAADAAAAAAAAAAAAAAAAAAAAAFAAAA"
    "AAAAAAAAAAAgQNwAAQAAQBC9EOLqBTAlAAAAAACAZAc8AFMABAAAAEDQ6IYDwASAAAAAAABS7HegAVRVVVUFAAAAqKqqqgL9"
    "QJQAAAAAAIhP/q9SCQATAAAAAAAACETAm4ABAAAgw+kUgSYEgAkAAQAAAABEIABCiV+5Uw=="
)


def uastc(size=(16, 12), blocks=BLOCKS, *, alpha=255, depth=0, layers=0, faces=1):
    """A KTX2 file of UASTC blocks with one colour each: mode 8 of the UASTC texture specification.

    A block of mode 8 holds the five bits 10111, then eight bits for each of red, green, blue and alpha.
    """
    level = b"".join(
        (0x17 | int.from_bytes(bytes((*color, alpha if color == GREY else 255)), "little") << 5).to_bytes(
            16, "little"
        )
        for row in blocks
        for color in row
    )
    # KTX 2.0, section 3.10: a basic descriptor of UASTC (colour model 166) with sRGB transfer.
    descriptor = struct.pack("<IIHH12B4xHBBIII", 44, 0, 2, 40, 166, 1, 2, 0, 3, 3, 0, 0, 16, 0, 0, 0, *SAMPLE)
    start = 80 + 24 + len(descriptor) + 4
    header = struct.pack("<9I", 0, 1, *size, depth, layers, faces, 1, 0)
    index = struct.pack("<4I2Q", 104, len(descriptor), 0, 0, 0, 0)
    levels = struct.pack("<3Q", start, len(level), len(level))
    return ktx2_images._IDENTIFIER + header + index + levels + descriptor + bytes(4) + level


def textured(triangle, content, *, plain=None, required=True):
    """Give the triangle a base colour of a KTX2 image, with a plain image beside it if there is one."""
    triangle.primitive["attributes"]["TEXCOORD_0"] = triangle.accessor(UV)
    texture = triangle.add_base_color_image(plain or b"")
    if plain is None:
        del texture["source"]
    source = triangle.add("images", {"bufferView": triangle.view(content), "mimeType": "image/ktx2"})
    texture["extensions"] = {"KHR_texture_basisu": {"source": source}}
    triangle.document["extensionsUsed"] = ["KHR_texture_basisu"]
    if required:
        triangle.document["extensionsRequired"] = ["KHR_texture_basisu"]
    return triangle.write("scene.glb")


# UASTC holds colours of blocks exactly; ETC1S rounds them to five bits a channel, half a step of 255 / 31.
@pytest.mark.parametrize(("content", "error"), [(uastc(), 0), (ETC1S, 4)], ids=["uastc", "etc1s"])
def test_texels_are_those_of_the_blocks(triangle, content, error):
    scene = read_scene(textured(triangle, content))
    (texture,) = scene.textures
    assert texture.texels_srgb.dtype == np.uint8
    difference = texture.texels_srgb.astype(int) - TEXELS
    assert difference.shape == (12, 16, 3)
    assert np.abs(difference).max() <= error
    assert scene.warnings == ()


def test_alpha_is_the_opacity_of_a_masked_material(triangle):
    path = textured(triangle, uastc(alpha=20))
    triangle.document["materials"][0]["alphaMode"] = "MASK"
    (texture,) = read_scene(triangle.write(path.name)).textures
    np.testing.assert_array_equal(texture.opacity, np.where((TEXELS == GREY).all(axis=-1), 20, 255))
    np.testing.assert_array_equal(texture.texels_srgb, TEXELS)


@pytest.mark.parametrize("required", [True, False])
def test_without_the_extra_a_texture_is_refused_by_name(triangle, monkeypatch, required):
    monkeypatch.setattr(ktx2_images, "_DECODER_MODULE", "no_such_module")
    path = textured(triangle, uastc(), required=required)
    line = f'{path}: images[1]: a KTX2 texture needs vpltune[ktx], which is not installed: pip install "vpltu'
    with pytest.raises(InputError, match=re.escape(line)):
        read_scene(path)


def test_a_plain_image_is_taken_without_a_word(triangle, monkeypatch):
    """Whether or not the extra is installed: a picture does not change with it."""
    monkeypatch.setattr(ktx2_images, "_DECODER_MODULE", "no_such_module")
    plain = Image.new("RGB", (2, 2), (1, 2, 3))
    scene = read_scene(textured(triangle, uastc(), plain=plain, required=False))
    assert scene.textures[0].texels_srgb[0, 0].tolist() == [1, 2, 3]
    assert scene.warnings == ()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (uastc()[:30], "images[1]: image is broken (cut off in its header)"),
        (uastc()[:-1], "images[1]: image is broken ("),
        (uastc((0, 12)), "must be one flat image, got 0 × 12 × 0 texels"),
        (uastc(depth=2), "must be one flat image, got 16 × 12 × 2 texels"),
        (uastc(layers=2), "must be one flat image, got 16 × 12 × 0 texels, 2 layers, 1 faces"),
        (uastc(faces=6), "must be one flat image, got 16 × 12 × 0 texels, 0 layers, 6 faces"),
        (uastc((MAX_IMAGE_SIDE + 4, 4)), "an image must be at most 16384 texels on a side"),
        (uastc((8192, 8192)), "images[1]: image is broken ("),
    ],
    ids=["header", "cut off", "empty", "solid", "layers", "cube", "side", "announces much"],
)
def test_other_files_are_refused_by_name_at_little_cost(triangle, content, said):
    assert said in check_cost(textured(triangle, content))


@pytest.fixture
def process():
    with LimitedDecoder("ktx2") as running:
        yield running


@pytest.mark.parametrize("content", [uastc(), ETC1S], ids=["uastc", "etc1s"])
def test_files_changed_at_random_are_read_or_refused_in_one_line(content, process):
    rng = random.Random(7)
    outcomes = {"read": 0, "refused": 0}
    for _ in range(300):
        changed = bytearray(content)
        for _ in range(rng.choice((1, 2, 8))):
            changed[rng.randrange(12, len(content))] = rng.choice((0, 255, rng.randrange(256)))
        try:
            Ktx2Decoder(ImageDecoder(GLTF_FORMATS), process).decode(bytes(changed), "images[0]")
            outcomes["read"] += 1
        except SceneFileError as error:
            assert "\n" not in str(error)
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 0
