"""Base colour: factors, textures in every pixel format, texture coordinates, and warnings about the rest."""

import io

import numpy as np
import pytest
from PIL import Image

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import image_texels, read_scene

UV = np.array([[0, 0], [1, 0], [0, 1]], np.float32)
GREY_RAMP = np.array([[0, 85, 170, 255]], np.uint8)


def texels_of(gltf, image):
    gltf.add_primitive(TEXCOORD_0=UV)
    gltf.add_base_color_image(image)
    (texture,) = read_scene(gltf.write("scene.glb")).textures
    return texture.texels_srgb


def test_factor_is_linear_and_white_where_absent(triangle):
    triangle.add_primitive()
    surface = {"baseColorFactor": [0.5, 0.25, 0.125, 0.5], "metallicFactor": 0}
    triangle.add("materials", {"name": "ochre", "pbrMetallicRoughness": surface})
    triangle.primitive["material"] = 0
    ochre, default = read_scene(triangle.write()).materials
    assert ochre.name == "ochre"
    np.testing.assert_array_equal(ochre.base_color, [0.5, 0.25, 0.125])
    np.testing.assert_array_equal(default.base_color, [1, 1, 1])


@pytest.mark.parametrize("factor", [[1.5, 0, 0, 1], [-0.1, 0, 0, 1], [1, 1, 1], "red", [1, 1, True, 1]])
def test_factors_that_are_no_reflectance_are_refused(triangle, factor):
    triangle.add("materials", {"pbrMetallicRoughness": {"baseColorFactor": factor}})
    triangle.primitive["material"] = 0
    with pytest.raises(InputError, match=r"materials\[0\]\.pbrMetallicRoughness\.baseColorFactor: must"):
        read_scene(triangle.write())


def test_texels_keep_their_bytes_and_their_rows(gltf):
    rgb = np.random.default_rng(4).integers(0, 256, (3, 5, 3), np.uint8)
    np.testing.assert_array_equal(texels_of(gltf, Image.fromarray(rgb)), rgb)


@pytest.mark.parametrize("mode", ["L", "LA", "P", "RGBA", "I;16", "1"])
def test_every_pixel_format_becomes_eight_bit_rgb(gltf, mode):
    if mode == "I;16":
        # An 8-bit step is 257 16-bit steps, so adding 100 rounds to the same 8-bit value.
        image = Image.fromarray(GREY_RAMP.astype(np.uint16) * 257 + np.array([[0, 100, 100, 0]], np.uint16))
    elif mode == "RGBA":
        image = Image.fromarray(
            np.concatenate([np.repeat(GREY_RAMP[..., None], 3, 2), GREY_RAMP[..., None] // 2], 2)
        )
    else:
        image = Image.fromarray(GREY_RAMP).convert(mode, dither=Image.Dither.NONE)
    expected = np.where(GREY_RAMP > 127, 255, 0) if mode == "1" else GREY_RAMP
    np.testing.assert_array_equal(texels_of(gltf, image), np.repeat(expected[..., None], 3, axis=2))


def test_sixteen_bit_colour(gltf):
    # A PNG with one pixel of 16-bit RGB. PIL can read but not write such a file.
    import struct
    import zlib

    def chunk(name, content):
        return (
            struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
        )

    header = struct.pack(">IIBBBBB", 1, 1, 16, 2, 0, 0, 0)
    pixel = zlib.compress(b"\0" + struct.pack(">HHH", 65535, 128 * 257, 0))
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixel) + chunk(b"IEND", b"")
    np.testing.assert_array_equal(texels_of(gltf, png), [[[255, 128, 0]]])


@pytest.mark.parametrize("format_name", ["JPEG", "WEBP"])
def test_other_image_formats(gltf, format_name):
    stream = io.BytesIO()
    Image.new("RGB", (8, 8), (200, 100, 50)).save(stream, format_name, quality=95)
    # Lossy compression of a uniform colour may shift it by up to 3.
    np.testing.assert_allclose(texels_of(gltf, stream.getvalue()), [[[200, 100, 50]] * 8] * 8, atol=3)


def transformed(gltf, transform, uv=UV):
    gltf.add_primitive(TEXCOORD_0=uv, TEXCOORD_1=uv + np.float32(10))
    extension = {"KHR_texture_transform": transform}
    gltf.add_base_color_image(Image.new("RGB", (2, 2)), extensions=extension)
    gltf.document["extensionsUsed"] = gltf.document["extensionsRequired"] = ["KHR_texture_transform"]
    (mesh,) = read_scene(gltf.write()).meshes
    return mesh.uv[mesh.triangles[0]]


def test_texture_transform_scales_then_turns_then_moves(gltf):
    # T · R · S by hand: (u, v) → (2u, 3v) → (3v, −2u), a counter-clockwise turn with v down → moved.
    uv = transformed(gltf, {"offset": [0.5, 0.25], "rotation": np.pi / 2, "scale": [2, 3]})
    np.testing.assert_allclose(uv, [[0.5, 0.25], [0.5, 0.25 - 2], [0.5 + 3, 0.25]], atol=1e-6)


def test_texture_transform_of_the_specifications_example(gltf):
    """ "Utilizes only the lower left quadrant of the source image, rotated clockwise 90°" (v points down)."""
    square = np.array([[0, 0], [1, 0], [1, 1]], np.float32)
    uv = transformed(gltf, {"offset": [0, 1], "rotation": 1.57079632679, "scale": [0.5, 0.5]}, square)
    np.testing.assert_allclose(uv, [[0, 1], [0, 0.5], [0.5, 0.5]], atol=1e-6)


def test_texture_transform_may_name_another_coordinate_set(gltf):
    np.testing.assert_allclose(
        transformed(gltf, {"texCoord": 1, "offset": [1, 0]}), UV + np.array([11, 10]), atol=1e-6
    )


def test_coordinate_set_of_the_texture(gltf):
    gltf.add_primitive(TEXCOORD_0=UV, TEXCOORD_1=UV * 2, TEXCOORD_2=UV * 3)
    gltf.add_base_color_image(Image.new("RGB", (2, 2)), texCoord=2)
    (mesh,) = read_scene(gltf.write()).meshes
    np.testing.assert_array_equal(mesh.uv[mesh.triangles[0]], UV * 3)


def test_missing_coordinates_are_said(triangle):
    triangle.add_base_color_image(Image.new("RGB", (2, 2)))
    scene = read_scene(triangle.write())
    assert scene.warnings == ("1 textured primitive has no texture coordinates; (0, 0) is used",)


def test_wraps_and_one_texture_for_equal_samplers(gltf):
    gltf.add_primitive(TEXCOORD_0=UV)
    texture = gltf.add_base_color_image(Image.new("RGB", (2, 2)))
    texture["sampler"] = gltf.add("samplers", {"wrapS": 33071, "wrapT": 33648})
    gltf.add_primitive(TEXCOORD_0=UV)["material"] = gltf.add(
        "materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    )
    scene = read_scene(gltf.write())
    assert [material.texture for material in scene.materials] == [0, 0]
    assert (scene.textures[0].wrap_u, scene.textures[0].wrap_v) == ("clamp_to_edge", "mirrored_repeat")
    gltf.document["samplers"][0] = {"wrapS": 1}
    with pytest.raises(InputError, match=r"samplers\[0\]\.wrapS: must be one of"):
        read_scene(gltf.write())


@pytest.mark.parametrize(
    ("image", "message"),
    [
        ({"uri": "nope.png"}, r"images\[0\]\.uri: 'nope\.png' cannot be read \(No such file"),
        ({"uri": "data:image/png;base64,AAAA"}, r"images\[0\]: image must be one of PNG, JPEG, WEBP"),
        ({"uri": "http://example.org/x.png"}, "must be a data: URI or a file in the scene's folder"),
        ({}, "key 'bufferView' is missing"),
    ],
)
def test_images_that_cannot_be_had_are_refused(gltf, image, message):
    gltf.add_primitive(TEXCOORD_0=UV)
    gltf.add_base_color_image(Image.new("RGB", (2, 2)))
    gltf.document["images"] = [image]
    with pytest.raises(InputError, match=message):
        read_scene(gltf.write())


def test_a_cut_off_image_is_refused(gltf):
    stream = io.BytesIO()
    Image.fromarray(np.random.default_rng(5).integers(0, 256, (64, 64, 3), np.uint8)).save(stream, "PNG")
    with pytest.raises(InputError, match="image is broken"):
        texels_of(gltf, stream.getvalue()[:6000])


def test_a_huge_image_is_refused_by_its_header(gltf):
    stream = io.BytesIO()
    Image.new("1", (16384, 8192)).save(stream, "PNG")
    with pytest.raises(
        InputError, match="at most 16384 texels on a side and 67,108,864 in all, got 16384 × 8192"
    ):
        texels_of(gltf, stream.getvalue())


def test_images_that_no_base_colour_uses_are_not_opened(triangle):
    triangle.document["images"] = [{"uri": "normals.png"}]
    triangle.document["textures"] = [{"source": 0}]
    triangle.add("materials", {"normalTexture": {"index": 0}})
    triangle.primitive["material"] = 0
    assert read_scene(triangle.write()).warnings == ()


@pytest.mark.parametrize(
    ("material", "warning"),
    [
        ({"emissiveFactor": [0, 1, 0]}, None),
        ({"alphaMode": "BLEND"}, None),
        (
            {
                "alphaMode": "BLEND",
                "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5], "metallicFactor": 0},
            },
            "1 material is see-through: light passes by its share, the camera sees it if half opaque or more",
        ),
        (
            {"extensions": {"KHR_materials_unlit": {}}},
            "1 material is unlit, and no other surface is there: it is lit like any other",
        ),
        (
            {"extensions": {"KHR_materials_diffuse_transmission": {}}},
            "1 material transmits light diffusely; it is drawn opaque",
        ),
        (
            {
                "emissiveFactor": [1, 1, 1],
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 0}},
            },
            None,
        ),
        # The default of metallicFactor is 1 (glTF 2.0 section 3.9.2).
        (
            {"pbrMetallicRoughness": {}},
            "1 material is metallic; its diffuse part is drawn, its reflections are not",
        ),
        (
            {"pbrMetallicRoughness": {"metallicFactor": 0, "metallicRoughnessTexture": {"index": 0}}},
            None,
        ),
        (
            {"pbrMetallicRoughness": {}, "extensions": {"KHR_materials_unlit": {}}},
            "1 material is unlit, and no other surface is there: it is lit like any other",
        ),
    ],
)
def test_what_a_diffuse_model_leaves_out_is_said(triangle, material, warning):
    triangle.add("materials", material)
    triangle.primitive["material"] = 0
    assert read_scene(triangle.write()).warnings == ((warning,) if warning else ())


@pytest.mark.parametrize(
    ("image", "cause"),
    [
        ({"uri": "metal.png"}, "images[0].uri: 'metal.png' cannot be read (No such file or directory)"),
        ({"uri": "data:image/png;base64,aGVsbG8="}, "images[0]"),
        ({"uri": "../metal.png"}, "images[0]"),
    ],
)
def test_a_metallic_image_that_cannot_be_read_leaves_the_factor(triangle, image, cause):
    """What dims a surface is no reason to refuse it, as a missing base colour is. It is tried once."""
    triangle.add("images", image)
    triangle.add("textures", {"source": 0})
    for factor in (0.25, 0.5):
        surface = {"metallicFactor": factor, "metallicRoughnessTexture": {"index": 0}}
        primitive = triangle.primitive if factor == 0.25 else triangle.add_primitive()
        primitive["material"] = triangle.add("materials", {"pbrMetallicRoughness": surface})
    scene = read_scene(triangle.write())
    assert scene.textures == ()
    assert [float(each.base_color[0]) for each in scene.materials] == [0.75, 0.5]
    said, metals = scene.warnings
    assert said.startswith(f"2 metallic textures count as white; for one, {cause}")
    assert metals.startswith("2 materials are metallic")


def test_like_warnings_are_counted(triangle):
    metal = {"pbrMetallicRoughness": {}}
    triangle.add_primitive()["material"] = triangle.add("materials", metal)
    triangle.primitive["material"] = triangle.add("materials", metal)
    assert read_scene(triangle.write()).warnings == (
        "2 materials are metallic; their diffuse parts are drawn, their reflections are not",
    )


def test_an_image_file_is_limited(triangle, monkeypatch):
    triangle.add_base_color_image(Image.new("RGB", (2, 2)))
    monkeypatch.setattr(image_texels, "MAX_IMAGE_BYTES", 10)
    with pytest.raises(InputError, match=r"images\[0\]: an image file must have at most 0 MiB, got 1 MiB"):
        read_scene(triangle.write())


def test_specular_glossiness_gives_its_diffuse_colour(triangle):
    extension = {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.1, 0.2, 0.3, 1]}}
    triangle.add("materials", {"extensions": extension})
    triangle.primitive["material"] = 0
    scene = read_scene(triangle.write())
    np.testing.assert_allclose(scene.materials[0].base_color, [0.1, 0.2, 0.3], rtol=1e-6)
    assert scene.warnings == ("1 material is specular-glossiness: its diffuse colour is used",)


def test_unknown_extensions_are_refused_where_required_and_else_said(triangle):
    triangle.document["extensionsUsed"] = ["VENDOR_thing", "KHR_materials_clearcoat"]
    assert read_scene(triangle.write()).warnings == ("extension 'VENDOR_thing' is ignored",)
    triangle.document["extensionsRequired"] = ["VENDOR_thing"]
    with pytest.raises(InputError, match="extensionsRequired: 'VENDOR_thing' is not supported"):
        read_scene(triangle.write())


def test_a_compressed_view_s_fallback_is_read(triangle):
    view = triangle.document["bufferViews"][0]
    view["extensions"] = {"EXT_meshopt_compression": {"buffer": 1}}
    assert read_scene(triangle.write()).triangle_count() == 1
