"""What a surface does with light beside its colour: masks, blending, transmission, metals, unlit ones."""

import numpy as np
import pytest
from PIL import Image

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.srgb import linear_from_srgb, srgb_from_linear
from vpltune.renderer.scene.files import read_scene

UV = np.array([[0, 0], [1, 0], [0, 1]], np.float32)


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
