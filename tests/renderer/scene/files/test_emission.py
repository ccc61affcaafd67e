"""Emission of glTF and MTL materials: values, textures, sides, and what is no emission."""

import io

import numpy as np
import pytest
from PIL import Image

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene

UV = np.array([[0, 0], [1, 0], [0, 1]], np.float32)


def glowing(gltf, strength=None, **members):
    material = {"emissiveFactor": [1.0, 0.5, 0.25], **members}
    if strength is not None:
        gltf.document["extensionsUsed"] = ["KHR_materials_emissive_strength"]
        material["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    gltf.primitive["material"] = gltf.add("materials", material)
    return gltf.write()


def add_image(gltf, colour, size=(2, 2)):
    content = io.BytesIO()
    Image.new("RGB", size, colour).save(content, "PNG")
    image = {"bufferView": gltf.view(content.getvalue()), "mimeType": "image/png"}
    return gltf.add("textures", {"source": gltf.add("images", image)})


def test_emission_is_factor_times_strength(triangle):
    (material,) = read_scene(glowing(triangle, 40.0, doubleSided=True)).materials
    assert material.emission == (40.0, 20.0, 10.0)
    assert material.glows and material.emits_both_ways


def test_one_sided_materials_emit_one_way(triangle):
    (material,) = read_scene(glowing(triangle)).materials
    assert material.emission == (1.0, 0.5, 0.25)
    assert not material.emits_both_ways


def test_black_metals_glow(triangle):
    black = {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 1}
    (material,) = read_scene(glowing(triangle, pbrMetallicRoughness=black)).materials
    assert material.glows
    assert not material.base_color.any()


def test_unlit_materials_emit_nothing(triangle):
    (material,) = read_scene(glowing(triangle, extensions={"KHR_materials_unlit": {}})).materials
    assert not material.glows


@pytest.mark.parametrize("strength", [-1.0, 1e19, 1e31])
def test_radiance_is_bounded(triangle, strength):
    with pytest.raises(InputError, match=r"materials\[0\].*emissive"):
        read_scene(glowing(triangle, strength))


def test_a_negative_factor_is_refused(triangle):
    with pytest.raises(InputError, match=r"materials\[0\]\.emissiveFactor: must not be negative"):
        read_scene(glowing(triangle, emissiveFactor=[1, -1, 0]))


def test_an_emissive_texture_has_its_own_coordinates_without_one_of_the_base_colour(gltf):
    gltf.add_primitive(TEXCOORD_0=UV, TEXCOORD_1=UV[::-1])
    move = {"KHR_texture_transform": {"offset": [0.5, 0.0], "scale": [2.0, 1.0]}}
    info = {"index": add_image(gltf, (255, 0, 0)), "texCoord": 1, "extensions": move}
    gltf.document["extensionsUsed"] = ["KHR_texture_transform"]
    scene = read_scene(glowing(gltf, emissiveTexture=info))
    (material,) = scene.materials
    assert (material.texture, material.emission_texture) == (None, 0)
    np.testing.assert_array_equal(scene.textures[0].texels_srgb[0, 0], (255, 0, 0))
    np.testing.assert_allclose(scene.meshes[0].uv, UV[::-1] * (2.0, 1.0) + (0.5, 0.0))
    assert scene.warnings == ()


def test_textures_placed_alike_share_the_coordinates(gltf):
    gltf.add_primitive(TEXCOORD_0=UV)
    base, glow = add_image(gltf, (0, 255, 0)), add_image(gltf, (255, 0, 0))
    base_color = {"baseColorTexture": {"index": base}, "metallicFactor": 0}
    scene = read_scene(glowing(gltf, pbrMetallicRoughness=base_color, emissiveTexture={"index": glow}))
    (material,) = scene.materials
    assert (material.texture, material.emission_texture) == (0, 1)
    assert material.emission == (1.0, 0.5, 0.25)


def test_an_emissive_texture_placed_otherwise_counts_by_its_mean(gltf):
    gltf.add_primitive(TEXCOORD_0=UV, TEXCOORD_1=UV)
    base, glow = add_image(gltf, (0, 255, 0)), add_image(gltf, (255, 0, 188))
    base_color = {"baseColorTexture": {"index": base}, "metallicFactor": 0}
    scene = read_scene(
        glowing(gltf, pbrMetallicRoughness=base_color, emissiveTexture={"index": glow, "texCoord": 1})
    )
    (material,) = scene.materials
    assert material.emission_texture is None
    # 188 in sRGB is 0.5029 (IEC 61966-2-1).
    np.testing.assert_allclose(material.emission, (1.0, 0.0, 0.25 * 0.5029), atol=1e-4)
    assert scene.warnings == (
        "1 emissive texture is placed otherwise than the base colour's; its mean counts",
    )


@pytest.mark.parametrize("image", ["absent", "broken"])
def test_without_its_image_the_factor_shines(gltf, tmp_path, image):
    gltf.add_primitive(TEXCOORD_0=UV)
    index = gltf.add("images", {"uri": "glow.png"})
    if image == "broken":
        (gltf.write().parent / "glow.png").write_bytes(b"no picture")
    info = {"index": gltf.add("textures", {"source": index})}
    scene = read_scene(glowing(gltf, 3.0, emissiveTexture=info))
    assert scene.materials[0].emission == (3.0, 1.5, 0.75)
    assert scene.materials[0].emission_texture is None
    assert len(scene.warnings) == 1
    assert scene.warnings[0].endswith("the emissive factor alone is used")


def test_the_front_of_a_mirrored_node_is_turned(triangle):
    """glTF 2.0, section 3.7.4: a negative determinant makes clockwise triangles the front."""
    path = glowing(triangle)
    plain = read_scene(path)
    triangle.document["nodes"][0]["scale"] = [1, 1, -1]
    mirrored = read_scene(triangle.write())
    fronts = [_world_front(scene) for scene in (plain, mirrored)]
    # A triangle in the plane z = 0, whose front faces +Z, faces −Z in the mirror.
    np.testing.assert_allclose(fronts[0], (0.0, 0.0, 1.0))
    np.testing.assert_allclose(fronts[1], (0.0, 0.0, -1.0))


def _world_front(scene):
    (instance,) = scene.instances
    mesh = scene.meshes[instance.mesh]
    corners = mesh.positions[mesh.triangles[0]] @ instance.to_world[:3, :3].T
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return normal / np.linalg.norm(normal)


OBJ = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"


def with_mtl(folder, statements):
    (folder / "a.mtl").write_text(f"newmtl m\n{statements}\n")
    (folder / "a.obj").write_text(OBJ)
    return read_scene(folder / "a.obj")


def test_ke_is_radiance_and_leaves_both_sides(tmp_path):
    (material,) = with_mtl(tmp_path, "Kd 0 0 0\nKe 40 20 10").materials
    assert material.emission == (40.0, 20.0, 10.0)
    assert material.emits_both_ways


def test_map_ke_multiplies_ke(tmp_path):
    Image.new("RGB", (2, 2), (0, 0, 255)).save(tmp_path / "glow map.png")
    scene = with_mtl(tmp_path, "Ke 4 4 4\nmap_Ke -clamp on glow map.png")
    (material,) = scene.materials
    texture = scene.textures[material.emission_texture]
    assert (material.emission, material.texture) == ((4.0, 4.0, 4.0), None)
    assert texture.wrap_u == "clamp_to_edge"
    np.testing.assert_array_equal(texture.texels_srgb[0, 0], (0, 0, 255))
    assert with_mtl(tmp_path, "map_Ke glow map.png").materials[0].emission == (1.0, 1.0, 1.0)
    dark = with_mtl(tmp_path, "Ke 0 0 0\nmap_Ke glow map.png")
    assert not dark.materials[0].glows
    assert dark.warnings == ("1 material is dark: its Ke 0 0 0 multiplies its map_Ke",)


@pytest.mark.parametrize("content", [None, b"no picture"])
def test_without_map_ke_the_factor_shines(tmp_path, content):
    if content is not None:
        (tmp_path / "glow.png").write_bytes(content)
    scene = with_mtl(tmp_path, "Ke 4 2 1\nmap_Ke glow.png")
    assert scene.materials[0].emission == (4.0, 2.0, 1.0)
    assert scene.materials[0].emission_texture is None
    assert len(scene.warnings) == 1
    assert "Ke alone is used" in scene.warnings[0]


@pytest.mark.parametrize("radiance", ["-1 0 0", "nan 0 0", "1e30 1 1", "1e999 1 1", "red"])
def test_ke_is_bounded(tmp_path, radiance):
    with pytest.raises(InputError, match=r"'a\.mtl' line 2: "):
        with_mtl(tmp_path, f"Ke {radiance}")
