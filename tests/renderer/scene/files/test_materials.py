"""Base colour: factors, textures in every pixel format, texture coordinates, and warnings about the rest."""

import io

import numpy as np
import pytest
from PIL import Image

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.srgb import linear_from_srgb, srgb_from_linear
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
        ({"emissiveFactor": [0, 1, 0]}, "1 material emits light; emission does not light the scene yet"),
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


def test_unlit_surfaces_are_left_out_beside_others(triangle):
    sky = np.array([[0, 0, 9], [9, 0, 9], [0, 9, 9]], np.float32)
    for _ in range(2):
        painted = triangle.add("materials", {"extensions": {"KHR_materials_unlit": {}}})
        triangle.add_primitive(sky)["material"] = painted
    scene = read_scene(triangle.write())
    assert len(scene.instances) == len(scene.materials) == 1
    # The sky does not count for the scene's size either.
    assert scene.bounds()[1][2] == 0.0
    assert scene.warnings == (
        "2 materials are unlit; their surfaces are left out: they cast no shadow and reflect no light",
    )


def masked(gltf, alpha: list[int], **members):
    """A scene of one triangle whose base colour has these alphas, and its material."""
    gltf.add_primitive(TEXCOORD_0=UV)
    gltf.add_base_color_image(Image.fromarray(np.array([[[9, 8, 7, a] for a in alpha]], np.uint8)))
    gltf.document["materials"][0] |= {"alphaMode": "MASK"} | members
    scene = read_scene(gltf.write())
    return scene, scene.materials[0]


def test_a_mask_has_its_texture_s_alpha_and_its_cutoff(gltf):
    scene, material = masked(gltf, [0, 200, 255], alphaCutoff=0.25)
    assert (material.alpha_mode, material.alpha_cutoff, material.opacity) == ("mask", 0.25, 1.0)
    np.testing.assert_array_equal(scene.textures[0].opacity, [[0, 200, 255]])
    np.testing.assert_array_equal(scene.textures[0].texels_srgb, [[[9, 8, 7]] * 3])
    assert scene.warnings == ()


@pytest.mark.parametrize("members", [{"alphaMode": "OPAQUE"}, {"alphaCutoff": 0.1}])
def test_an_alpha_that_cuts_nothing_is_opaque(gltf, members):
    _, material = masked(gltf, [30, 255], **members)
    assert material.is_opaque


def test_one_image_serves_opaque_and_masked_materials(gltf):
    for primitive in (gltf.add_primitive(TEXCOORD_0=UV), gltf.add_primitive(TEXCOORD_0=UV)):
        primitive["material"] = gltf.add("materials", {})
    gltf.add_base_color_image(Image.new("RGBA", (1, 1), (9, 8, 7, 0)))
    surface = gltf.document["materials"].pop()
    gltf.document["materials"] = [surface, surface | {"alphaMode": "MASK"}]
    for primitive, material in zip(gltf.document["meshes"][0]["primitives"], (0, 1), strict=True):
        primitive["material"] = material
    scene = read_scene(gltf.write())
    assert [texture.opacity is None for texture in scene.textures] == [True, False]
    assert [material.is_opaque for material in scene.materials] == [True, False]


@pytest.mark.parametrize("cutoff", [-0.1, "half"])
def test_a_cutoff_out_of_range_is_refused(triangle, cutoff):
    triangle.primitive["material"] = triangle.add("materials", {"alphaMode": "MASK", "alphaCutoff": cutoff})
    with pytest.raises(InputError, match=r"materials\[0\]\.alphaCutoff: must be a finite number"):
        read_scene(triangle.write())


def test_a_blended_material_has_its_factor_and_its_texture_s_alpha(gltf):
    gltf.add_primitive(TEXCOORD_0=UV)
    gltf.add_base_color_image(Image.new("RGBA", (1, 1), (9, 8, 7, 51)))
    material = gltf.document["materials"][0] | {"alphaMode": "BLEND"}
    material["pbrMetallicRoughness"]["baseColorFactor"] = [1, 1, 1, 0.5]
    gltf.document["materials"][0] = material
    scene = read_scene(gltf.write())
    assert (scene.materials[0].alpha_mode, scene.materials[0].opacity) == ("blend", 0.5)
    np.testing.assert_array_equal(scene.textures[0].opacity, [[51]])


@pytest.mark.parametrize(
    ("factor", "metallic", "opacity", "color"),
    [
        # All of the white light passes; nothing is left to reflect.
        (1.0, 0.0, 0.0, [0, 0, 0]),
        # A tint of 1, ½, 0 passes a half; a quarter of it is transmitted, and three quarters reflected.
        (0.25, 0.0, 0.875, [0.75 / 0.875, 0.375 / 0.875, 0.0]),
        # Half of it is metal, which neither transmits nor reflects diffusely.
        (0.5, 0.5, 1.0 - 0.25 * 0.25, [0.5 * 0.75 / 0.9375, 0.25 * 0.75 / 0.9375, 0.0]),
        (0.0, 0.0, 1.0, [1.0, 0.5, 0.0]),
    ],
)
def test_transmission_passes_the_tinted_share(triangle, factor, metallic, opacity, color):
    tint = [1.0, 1.0, 1.0, 1.0] if factor == 1.0 else [1.0, 0.5, 0.0, 1.0]
    transmission = {"KHR_materials_transmission": {"transmissionFactor": factor}}
    surface = {"baseColorFactor": tint, "metallicFactor": metallic}
    triangle.add("materials", {"pbrMetallicRoughness": surface, "extensions": transmission})
    triangle.primitive["material"] = 0
    (material,) = read_scene(triangle.write()).materials
    assert material.is_opaque is (factor == 0.0)
    assert material.opacity == pytest.approx(opacity)
    # float32.
    np.testing.assert_allclose(material.base_color, color, rtol=1e-6)


def test_like_warnings_are_counted(triangle):
    triangle.add_primitive()["material"] = triangle.add("materials", {"emissiveFactor": [1, 1, 1]})
    triangle.primitive["material"] = triangle.add("materials", {"emissiveFactor": [1, 1, 1]})
    assert read_scene(triangle.write()).warnings == (
        "2 materials emit light; emission does not light the scene yet",
    )


def test_an_image_file_is_limited(triangle, monkeypatch):
    triangle.add_base_color_image(Image.new("RGB", (2, 2)))
    monkeypatch.setattr(image_texels, "MAX_IMAGE_BYTES", 10)
    with pytest.raises(InputError, match=r"images\[0\]: an image file must have at most 0 MiB, got 1 MiB"):
        read_scene(triangle.write())


def test_metals_are_counted(triangle):
    for primitive in (triangle.add_primitive(), triangle.primitive):
        primitive["material"] = triangle.add("materials", {"pbrMetallicRoughness": {"metallicFactor": 1}})
    assert read_scene(triangle.write()).warnings == (
        "2 materials are metallic; their diffuse parts are drawn, their reflections are not",
    )


def metallic_image(*blue: int) -> Image.Image:
    return Image.fromarray(np.array([[[255, 128, b] for b in blue]], np.uint8))


def test_a_metal_has_the_diffuse_part_of_its_factor(triangle):
    surface = {"baseColorFactor": [0.8, 0.4, 0.2, 1.0], "metallicFactor": 0.75}
    triangle.primitive["material"] = triangle.add("materials", {"pbrMetallicRoughness": surface})
    # A quarter of the base colour, in float32.
    np.testing.assert_allclose(
        read_scene(triangle.write()).materials[0].base_color, [0.2, 0.1, 0.05], rtol=1e-6
    )


@pytest.mark.parametrize("has_color", [True, False])
def test_a_metal_is_dimmed_texel_by_texel_by_the_blue_channel(triangle, has_color):
    rgb = np.array([[[200, 100, 50]] * 3], np.uint8)
    triangle.add_primitive(TEXCOORD_0=UV)
    triangle.add_base_color_image(Image.fromarray(rgb))
    color_texture = triangle.document["materials"][0]["pbrMetallicRoughness"].pop("baseColorTexture")
    triangle.add_base_color_image(metallic_image(0, 255, 51))
    surface = triangle.document["materials"][1]["pbrMetallicRoughness"]
    surface |= {"metallicRoughnessTexture": surface.pop("baseColorTexture"), "metallicFactor": 0.5}
    if has_color:
        surface["baseColorTexture"] = color_texture
    (texture,) = read_scene(triangle.write()).textures
    linear = linear_from_srgb((rgb if has_color else 255 * np.ones_like(rgb)) / 255.0)
    expected = linear * (1.0 - 0.5 * np.array([0, 255, 51])[None, :, None] / 255.0)
    # Half a step of the sRGB bytes that the products are kept in.
    np.testing.assert_allclose(texture.texels_srgb, 255.0 * srgb_from_linear(expected), atol=0.501)
    np.testing.assert_array_equal(texture.texels_srgb[0, 0], rgb[0, 0] if has_color else [255] * 3)


def test_a_metallic_texture_of_one_value_is_a_factor(triangle):
    triangle.add_base_color_image(metallic_image(51, 51))
    surface = triangle.document["materials"][0]["pbrMetallicRoughness"]
    surface |= {"metallicRoughnessTexture": surface.pop("baseColorTexture"), "metallicFactor": 1.0}
    scene = read_scene(triangle.write())
    assert scene.textures == ()
    np.testing.assert_allclose(scene.materials[0].base_color, 0.8, rtol=1e-6)


def test_a_metallic_texture_placed_otherwise_counts_by_its_mean(triangle):
    triangle.add_primitive(TEXCOORD_0=UV)
    triangle.add_base_color_image(metallic_image(0, 102))
    surface = triangle.document["materials"][0]["pbrMetallicRoughness"]
    surface["metallicRoughnessTexture"] = surface["baseColorTexture"] | {"texCoord": 1}
    surface["metallicFactor"] = 1.0
    scene = read_scene(triangle.write())
    # 1 − 51/255.
    np.testing.assert_allclose(scene.materials[0].base_color, 0.8, rtol=1e-6)
    assert "1 metallic texture is placed otherwise than the base colour's; its mean counts" in scene.warnings


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
