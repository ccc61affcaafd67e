"""RSM faces contain the scene, turn smoothly with their light, and keep their grid while bounds change."""

import dataclasses

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS

from vpltune.renderer.scene.light_faces import face_count, light_records
from vpltune.renderer.scene.scene import Light
from vpltune.renderer.scene.sun_faces import SIZE_STEP, SunGrid

TIGHT = SunGrid(256, (0.0, 0.0, 0.0))
SNAPPED = SunGrid(256, (0.0, 0.0, 0.0), length=5.0)


def sun(direction):
    return Light("directional", np.ones(3), direction_world=np.array(direction) / np.linalg.norm(direction))


def corners_on_face(record, bounds):
    """The corners of `bounds` in face coordinates. They are in [−1, 1] if the face contains them."""
    corners = bounds[[[c >> axis & 1 for axis in range(3)] for c in range(8)], np.arange(3)]
    matrix = record["light_to_world"].astype(np.float64).T
    return ((corners - matrix[:3, 3]) @ matrix[:3, :3])[:, :2] / record["extent"]


@pytest.mark.parametrize("grid", [TIGHT, SNAPPED], ids=["tight", "snapped"])
def test_a_suns_face_holds_all_bounds(grid):
    random = np.random.default_rng(2)
    for _ in range(200):
        bounds = np.sort(random.normal(size=(2, 3)) * 10.0 ** random.uniform(-2, 2), axis=0)
        (face,) = light_records((sun(random.normal(size=3)),), bounds, grid).faces
        assert np.abs(corners_on_face(face, bounds)).max() < 1.0


def test_a_snapped_grid_stands_still_while_bounds_move():
    """Few sizes occur, and faces of the same size are whole cells apart, so no texel crawls."""
    light = sun([0.3, -1.0, 0.2])
    faces = []
    for growth in np.linspace(0.0, 2.0, 101):
        bounds = np.array([[-1.0, 0.0, -1.0], [1.0 + growth, 0.5 + 0.7 * growth, 1.0]])
        faces.append(light_records((light,), bounds, SNAPPED).faces[0])
    extents = np.array([face["extent"] for face in faces], np.float64)
    assert len(np.unique(extents, axis=0)) < 15
    steps = np.log(extents / 5.0) / np.log(SIZE_STEP)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-5)
    matrices = np.array([face["light_to_world"].T for face in faces], np.float64)
    across = np.einsum("nij,ni->nj", matrices[:, :3, :3], matrices[:, :3, 3])[:, :2]
    cells = across / (2.0 * extents / SNAPPED.cells)
    # 1e-3 of a cell: faces are stored in float32.
    np.testing.assert_allclose(cells, np.round(cells), atol=1e-3)


def test_snapping_costs_little_size():
    bounds = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    for tilt in np.linspace(0.0, 1.5, 20):
        light = sun([np.sin(tilt), -np.cos(tilt), 0.1])
        fitted, snapped = (
            light_records((light,), bounds, grid).faces[0]["extent"] for grid in (TIGHT, SNAPPED)
        )
        assert (snapped >= fitted).all()
        assert (snapped <= fitted * SIZE_STEP * 1.01).all()


def test_a_turning_light_turns_its_face_smoothly():
    """A spot that sweeps through straight down never makes its face roll over.

    The face may turn at most three times as far as the axis, a bound for the roll down from the horizon.
    """
    spot = ROOM_LIGHTS["spot"]
    bounds = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    for heading in (0.0, 0.7, 1.9):
        angles = np.linspace(-1.5, 1.5, 301)
        faces = [
            light_records((dataclasses.replace(spot, direction_world=direction),), bounds, TIGHT).faces[0]
            for angle in angles
            for direction in [
                np.array([np.sin(angle) * np.cos(heading), -np.cos(angle), np.sin(angle) * np.sin(heading)])
            ]
        ]
        rotations = np.array([face["light_to_world"][:3, :3].T for face in faces], np.float64)
        between = np.einsum("nij,nik->njk", rotations[:-1], rotations[1:])
        turned = np.arccos(np.clip((np.trace(between, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
        assert turned.max() < 3.0 * (angles[1] - angles[0])


@pytest.mark.parametrize("direction", [[0, 1, 0], [0, -1, 0], [1e-6, 1, 0], [1, 0, 0], [0, 0, 1]])
def test_any_direction_has_a_rigid_face(direction):
    light = dataclasses.replace(
        ROOM_LIGHTS["spot"], direction_world=np.array(direction) / np.linalg.norm(direction)
    )
    (face,) = light_records((light,), np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]), TIGHT).faces
    rotation = face["light_to_world"][:3, :3].T.astype(np.float64)
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-6)
    assert np.linalg.det(rotation) > 0.0
    np.testing.assert_allclose(-rotation[:, 2], light.direction_world, atol=1e-6)


def test_faces_are_counted_without_a_scene():
    lights = tuple(ROOM_LIGHTS.values())
    bounds = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    for nested in (0, 2):
        grid = SunGrid(256, (0.0, 0.0, 0.0), nested)
        assert face_count(lights, nested) == len(light_records(lights, bounds, grid).faces) == 13 + nested


@pytest.mark.parametrize("direction", [[0.0, -2.0, 0.0], [0.0, 0.0, 0.0], [np.nan, 0.0, 1.0]])
@pytest.mark.parametrize("kind", ["spot", "directional"])
def test_a_direction_that_is_no_unit_vector_is_refused(kind, direction):
    with pytest.raises(ValueError, match=r"Light\.direction_world: must be a unit vector, got \["):
        Light(kind, np.ones(3), direction_world=np.array(direction))
