"""The node hierarchy: composed, mirrored, instanced and deformed transforms, and rejected graphs."""

import numpy as np
import pytest

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.transforms import transform_normals, transform_points

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
HALF = np.sqrt(0.5)
QUARTER_TURN_ABOUT_Z = [0, 0, HALF, HALF]


def placed_corners(scene):
    (instance,) = scene.instances
    mesh = scene.meshes[instance.mesh]
    return transform_points(instance.to_world, mesh.positions[mesh.triangles[0]])


def test_translation_rotation_and_scale_of_a_chain(triangle):
    # Child: scaled by 2, a quarter turn about z, moved along x. Parent: moved along y.
    triangle.document["nodes"] = [
        {"children": [1], "translation": [0, 10, 0]},
        {"mesh": 0, "translation": [5, 0, 0], "rotation": QUARTER_TURN_ABOUT_Z, "scale": [2, 2, 2]},
    ]
    np.testing.assert_allclose(
        placed_corners(read_scene(triangle.write())), [[5, 10, 0], [5, 12, 0], [3, 10, 0]], atol=1e-12
    )


def test_a_matrix_is_stored_column_by_column(triangle):
    triangle.node["matrix"] = [0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 5, 10, 0, 1]
    np.testing.assert_allclose(
        placed_corners(read_scene(triangle.write())), [[5, 10, 0], [5, 12, 0], [3, 10, 0]], atol=1e-12
    )


def test_far_from_the_origin_nothing_is_rounded(triangle):
    # Moved by 1e9 and back. float32 would lose 64 units.
    triangle.document["nodes"] = [
        {"children": [1], "translation": [1e9, 0, 0]},
        {"mesh": 0, "translation": [-1e9 + 0.125, 0, 0]},
    ]
    np.testing.assert_array_equal(
        placed_corners(read_scene(triangle.write())), TRIANGLE + np.array([0.125, 0, 0])
    )


@pytest.mark.parametrize("scale", [[-1, 1, 1], [1, -2, 1], [-1, -1, -1], [3, 1, 1]])
@pytest.mark.parametrize("has_normals", [True, False])
def test_normals_stay_on_their_side_of_mirrored_and_stretched_surfaces(gltf, scale, has_normals):
    slope = np.array([[0, 0, 0], [1, 0, 1], [0, 1, 0]], np.float32)
    normal = np.array([-HALF, 0, HALF], np.float32)
    gltf.add_primitive(slope, **({"NORMAL": np.tile(normal, (3, 1))} if has_normals else {}))
    gltf.node["scale"] = scale
    scene = read_scene(gltf.write())
    corners = placed_corners(scene)
    geometric = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    geometric /= np.linalg.norm(geometric)
    shading = transform_normals(scene.instances[0].to_world, scene.meshes[0].normals)
    # 1e-6: normals are stored in float32.
    np.testing.assert_allclose(shading, np.tile(geometric, (3, 1)), atol=1e-6)


def test_only_the_active_scene_is_read(triangle):
    triangle.document["nodes"] = [
        {"mesh": 0, "name": "a"},
        {"mesh": 0, "name": "b"},
        {"mesh": 0, "name": "c"},
    ]
    triangle.document["scenes"] = [{"nodes": [0]}, {"nodes": [2, 1]}]
    triangle.document["scene"] = 1
    scene = read_scene(triangle.write())
    assert [instance.name for instance in scene.instances] == ["c", "b"]
    del triangle.document["scene"]
    scene = read_scene(triangle.write())
    assert [instance.name for instance in scene.instances] == ["a"]
    assert scene.warnings == ("the file selects none of its 2 scenes: the first one is read",)
    del triangle.document["scenes"]
    scene = read_scene(triangle.write())
    assert len(scene.instances) == 3
    assert scene.warnings == ("the file has no scene: all of its nodes are shown",)


def test_invisible_nodes_hide_what_is_below(triangle):
    triangle.document["nodes"] = [
        {"children": [1, 2]},
        {"mesh": 0, "name": "seen"},
        {"children": [3], "extensions": {"KHR_node_visibility": {"visible": False}}},
        {"mesh": 0, "name": "hidden"},
    ]
    assert [instance.name for instance in read_scene(triangle.write()).instances] == ["seen"]


def test_gpu_instancing(triangle):
    attributes = {
        "TRANSLATION": triangle.accessor(np.array([[1, 0, 0], [0, 2, 0]], np.float32)),
        "ROTATION": triangle.accessor(np.array([[0, 0, 0, 1], QUARTER_TURN_ABOUT_Z], np.float32)),
        "SCALE": triangle.accessor(np.array([[1, 1, 1], [3, 3, 3]], np.float32)),
    }
    triangle.node["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    triangle.node["translation"] = [0, 0, 7]
    triangle.document["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    scene = read_scene(triangle.write())
    assert len(scene.meshes) == 1
    first, second = (transform_points(i.to_world, TRIANGLE) for i in scene.instances)
    np.testing.assert_allclose(first, [[1, 0, 7], [2, 0, 7], [1, 1, 7]], atol=1e-6)
    np.testing.assert_allclose(second, [[0, 2, 7], [0, 5, 7], [-3, 2, 7]], atol=1e-6)


def test_a_flattened_axis_is_a_surface_still_and_two_are_not(triangle):
    triangle.node["scale"] = [1, 1, 0]
    assert read_scene(triangle.write()).triangle_count() == 1
    triangle.node["scale"] = [1, 0, 0]
    with pytest.raises(InputError, match="has no triangles .1 node is scaled to a line or a point"):
        read_scene(triangle.write())


def test_a_chain_of_any_length(triangle):
    # Deeper than Python's stack. Each link moves by 0.01.
    count = 5000
    triangle.document["nodes"] = [{"children": [i + 1], "translation": [0.01, 0, 0]} for i in range(count)]
    triangle.document["nodes"].append({"mesh": 0})
    # 1e-9: 5,000 roundings in double precision.
    np.testing.assert_allclose(
        placed_corners(read_scene(triangle.write())), TRIANGLE + np.array([50, 0, 0]), atol=1e-9
    )


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        ([{"children": [0]}], r"nodes\[0\]: is its own ancestor"),
        ([{"mesh": 0}, {"children": [2]}, {"children": [1]}], r"nodes\[1\]: is its own ancestor"),
        (
            [{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}],
            r"nodes\[2\]: must have one parent, got 0 and 1",
        ),
        ([{"children": [7]}], r"nodes\[0\]\.children\[0\]: must be an index into the 1 nodes, got 7"),
        ([{"mesh": 1}], r"nodes\[0\]\.mesh: must be an index into the 1 meshes, got 1"),
        ([{"mesh": 0, "rotation": [0, 0, 0, 0]}], r"nodes\[0\]\.rotation: must be a unit quaternion"),
        ([{"mesh": 0, "rotation": "abcd"}], r"nodes\[0\]\.rotation: must be a list of 4 finite numbers"),
        ([{"mesh": 0, "scale": [1e20] * 3}], r"nodes\[0\]: its transform to the world must stay within"),
        ([{"mesh": 0, "matrix": [*range(16)]}], r"nodes\[0\]\.matrix: its last row must be 0 0 0 1"),
        ([{"mesh": 0, "matrix": [1, 2, 3]}], r"nodes\[0\]\.matrix: must be a list of 16 finite numbers"),
        (
            [{"mesh": 0, "scale": [1, 1, 1], "matrix": np.eye(4).ravel().tolist()}],
            r"nodes\[0\]: must not have both matrix and scale",
        ),
    ],
)
def test_broken_hierarchies_are_refused(triangle, nodes, message):
    triangle.document["nodes"] = nodes
    with pytest.raises(InputError, match=message):
        read_scene(triangle.write())


@pytest.mark.parametrize("listed", [[0, 1, 2], [2, 1, 0], [2, 0]])
def test_a_scene_that_lists_children_draws_each_node_once(triangle, listed):
    parent = {"children": [1], "translation": [1, 0, 0]}
    triangle.document["nodes"] = [parent, {"mesh": 0, "children": [2]}, {"mesh": 0, "translation": [2, 0, 0]}]
    triangle.document["scenes"] = [{"nodes": listed}]
    scene = read_scene(triangle.write())
    assert [instance.to_world[0, 3] for instance in scene.instances] == [1.0, 3.0]
    (warning,) = scene.warnings
    assert warning.startswith("scenes[0].nodes: must be root nodes, and ")


def test_a_listed_child_of_a_node_that_is_not_is_placed_by_it(triangle):
    triangle.document["nodes"] = [{"children": [1], "translation": [1, 0, 0]}, {"mesh": 0}]
    triangle.document["scenes"] = [{"nodes": [1]}]
    (instance,) = read_scene(triangle.write()).instances
    assert instance.to_world[0, 3] == 1.0


def test_a_rotation_off_unit_length_is_normalised_aloud(triangle):
    triangle.node["rotation"] = [0, 0, 3, 3]
    scene = read_scene(triangle.write())
    np.testing.assert_allclose(placed_corners(scene), [[0, 0, 0], [0, 1, 0], [-1, 0, 0]], atol=1e-12)
    assert scene.warnings == ("1 node has a rotation that is not a unit quaternion; it is normalised",)


def test_morph_targets_at_the_default_weights(triangle):
    displaced = np.array([[0, 0, 1], [0, 0, 2], [0, 0, 3]], np.float32)
    target = {"POSITION": triangle.accessor(displaced)}
    triangle.primitive["targets"] = [target]
    triangle.document["meshes"][0]["weights"] = [0.5]
    triangle.document["nodes"].append({"mesh": 0, "weights": [2.0]})
    triangle.document["scenes"] = [{"nodes": [0, 1]}]
    by_mesh, by_node = read_scene(triangle.write()).meshes
    np.testing.assert_allclose(by_mesh.positions[by_mesh.triangles[0]], TRIANGLE + 0.5 * displaced)
    np.testing.assert_allclose(by_node.positions[by_node.triangles[0]], TRIANGLE + 2.0 * displaced)
    # Flat shading follows the morphed surface, not the stored one.
    assert abs(by_node.normals[0] @ (by_node.positions[1] - by_node.positions[0])) < 1e-6


def test_a_skin_stands_where_its_joints_are(gltf):
    # Joint 0 is at the origin, joint 1 at x = 1 in the bind pose and lifted by 4 in the file's pose.
    joints = np.array([[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], np.uint8)
    weights = np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0.5, 0.5, 0, 0]], np.float32)
    normals = np.tile(np.array([0, 0, 1], np.float32), (3, 1))
    gltf.add_primitive(JOINTS_0=joints, WEIGHTS_0=weights, NORMAL=normals)
    inverse_bind = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    inverse_bind[1, 0, 3] = -1
    stored = np.ascontiguousarray(inverse_bind.transpose(0, 2, 1).reshape(2, 16))
    gltf.document["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [100, 100, 100]},
        {"translation": [0, 0, 0]},
        {"translation": [1, 0, 4]},
    ]
    gltf.document["scenes"] = [{"nodes": [0, 1, 2]}]
    gltf.document["skins"] = [{"joints": [1, 2], "inverseBindMatrices": gltf.accessor(stored)}]
    scene = read_scene(gltf.write())
    np.testing.assert_allclose(placed_corners(scene), [[0, 0, 0], [1, 0, 4], [0, 1, 2]], atol=1e-6)
    np.testing.assert_allclose(scene.meshes[0].normals, normals, atol=1e-6)
    gltf.document["skins"][0]["joints"] = [1]
    with pytest.raises(InputError, match="joints must be below 1"):
        read_scene(gltf.write())
