"""An image by `examples/formulas` alone is the runtime's: docs/runtime_formulas.md step by step."""

import dataclasses

import numpy as np
import pytest
from point_vpls import point_vpls
from vector_file import BOUNDS, DIAGONAL, VECTORS, boxes, light_of

from examples.formulas import visibility_maps
from examples.formulas.boxes import nearest_hit
from examples.formulas.clustered_discs import lloyd_iteration, sample_count
from examples.formulas.point_table import STEP, r2_points
from examples.formulas.punctual_lights import cone_falloff, light_faces, towards_light
from examples.formulas.reflective_shadow_map import (
    rsm_texels,
    scene_length,
    stored_depth,
    texel_centers,
    texel_rays,
)
from examples.formulas.virtual_point_lights import Vpls, draw_vpls, sampling_weights
from examples.formulas.vpl_gather import gather
from examples.formulas.vpl_importance import importance_cells, importance_factor
from vpltune import Runtime, TunedConfig, View
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.transforms import look_at

RESOLUTION = 64
LIGHT = VECTORS["rsm"]["light"]
BOXES = VECTORS["boxes"]
POINTS = point_vpls(
    vpl_count=16,
    intensity=1.3,
    falloff_footprint=0.7,
    extinction_coefficient=0.4,
    density_exponent=0.6,
    visibility_bias=0.01,
    visibility_softness=0.1,
)
DISCS = dataclasses.replace(POINTS, lloyd_iterations=2, falloff_footprint=1.0, density_exponent=1.0)


def view() -> View:
    camera = Camera(look_at(np.array([1.8, 1.6, 2.4]), np.array([-0.2, 0.4, -1.0])), 0.9)
    return View("boxes", "fitted", (24, 18), camera, (light_of(LIGHT),))


def face_texels():
    """The RSM by rays through the boxes."""
    face = {**light_faces(LIGHT, BOUNDS, BOUNDS, RESOLUTION)[0], "resolution": RESOLUTION}
    size = (RESOLUTION, RESOLUTION)
    depth, normal, reflectance = np.zeros(size), np.zeros((*size, 3)), np.zeros((*size, 3))
    origins, rays = texel_rays(face, texel_centers(RESOLUTION))
    for at in np.ndindex(size):
        distance, box, met_normal = nearest_hit(BOXES, origins[at], rays[at])
        if box >= 0:
            depth[at] = stored_depth(face, np.float64(distance))
            normal[at] = met_normal
            met = origins[at] + distance * rays[at]
            cone = cone_falloff(LIGHT, -towards_light(LIGHT, met[None]))[0]
            reflectance[at] = np.array(BOXES[box]["reflectance"]) * cone
    return face, rsm_texels(LIGHT, face, depth, normal, reflectance)


def placed(parameters: ArtistParameters, captured) -> tuple[Vpls, float]:
    """VPLs and L; the image is looked at for importance alone."""
    face, texels = face_texels()
    length = scene_length([texels])
    factor = 1.0
    if parameters.density_importance > 0.0:
        height, width = captured.valid.shape
        place = (0.5 + np.arange(1, 129)[:, None] * STEP) % 1.0
        column, row = np.floor(place * [width, height]).astype(int).T
        seen = captured.valid[height - 1 - row, column]
        position, normal = (
            values[height - 1 - row, column][seen].astype(np.float64)
            for values in (captured.position_world, captured.normal_world)
        )
        cells = importance_cells(texels, 64)
        _, of_cells = importance_factor(position, normal, cells, parameters.density_importance)
        at = np.arange(RESOLUTION) * 64 // RESOLUTION
        factor = of_cells[np.ix_(at, at)]
    weights = sampling_weights(texels, parameters.density_exponent, factor)
    count = parameters.vpl_count
    if parameters.lloyd_iterations == 0:
        return draw_vpls(texels, face, weights, r2_points(count)), length
    samples = draw_vpls(texels, face, weights, r2_points(sample_count(count)))
    vpls = Vpls(*(part[:count] for part in dataclasses.astuple(samples)))
    for _ in range(parameters.lloyd_iterations):
        vpls = lloyd_iteration(vpls, samples, length)
    return vpls, length


def cast_map(vpl: dict, length: float, size: int, refinement: int) -> dict[str, np.ndarray]:
    """The map of one VPL, by rays through the boxes."""
    frame = visibility_maps.hemisphere_frame(vpl["normal"])
    origin = visibility_maps.map_origin(vpl["position"], vpl["normal"], vpl["footprint"])

    def cast(side: int) -> tuple[np.ndarray, np.ndarray]:
        end, normal = np.zeros((side, side, 3)), np.zeros((side, side, 3))
        for row, column in np.ndindex(side, side):
            axis = visibility_maps.texel_axis(np.float64(column), np.float64(row), side)
            distance, box, met_normal = nearest_hit(BOXES, origin, frame.T @ axis)
            met = box >= 0 and distance < DIAGONAL
            end[row, column] = axis * (distance if met else visibility_maps.NOTHING * DIAGONAL) / length
            normal[row, column] = frame @ met_normal if met else -axis
        return end, normal

    end, normal = cast(size)
    farthest = visibility_maps.FARTHEST * DIAGONAL / length
    edge = visibility_maps.is_silhouette(end, normal, farthest)
    block = np.full((size, size), -1)
    block[edge] = np.arange(edge.sum())
    finer = [
        values.reshape(size, refinement, size, refinement, 3).swapaxes(1, 2)[edge]
        for values in cast(size * refinement)
    ]
    return {
        "end": end,
        "normal": normal,
        "corner": visibility_maps.corner_marks(end, normal, farthest),
        "block": block,
        "block_end": finer[0],
        "block_normal": finer[1],
    }


def drawn_by_formulas(config: TunedConfig, captured) -> np.ndarray:
    """[receivers, 3] irradiance at the runtime's receivers."""
    parameters, quality = config.parameters, config.quality
    vpls, length = placed(parameters, captured)
    assert captured.scene_length == pytest.approx(length, rel=1e-3)
    position = captured.position_world[captured.valid].astype(np.float64)
    normal = captured.normal_world[captured.valid].astype(np.float64)
    seen = np.ones((len(position), parameters.vpl_count))
    if config.visibility == "maps":
        for j in range(parameters.vpl_count):
            vpl = {
                "position": vpls.position[j],
                "normal": vpls.normal[j],
                "footprint": float(vpls.footprint[j]),
            }
            maps = cast_map(vpl, length, quality.map_size, quality.map_refinement)
            bias, softness = parameters.visibility_bias, parameters.visibility_softness
            for i in range(len(position)):
                seen[i, j] = visibility_maps.vpl_visibility(
                    position[i], normal[i], vpl, maps, length, bias, softness
                )
    per_watt = gather(
        position,
        normal,
        vpls,
        length,
        discs=parameters.lloyd_iterations > 0,
        intensity=parameters.intensity,
        alpha=parameters.falloff_footprint,
        kappa=parameters.extinction_coefficient,
        visibility=seen,
    )
    return per_watt @ vpls.flux


@pytest.mark.parametrize("visibility", ["transmittance", pytest.param("maps", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "parameters",
    [POINTS, DISCS, dataclasses.replace(POINTS, density_importance=0.7)],
    ids=["points", "discs", "importance"],
)
def test_an_image_by_formulas_is_the_runtimes(gl_context, parameters, visibility):
    """To 2e-3 relative RMSE: reflectances are half floats in the runtime, normals have 16 bits a channel."""
    config = TunedConfig(
        parameters,
        visibility=visibility,
        quality=Quality(rsm_resolution=RESOLUTION, map_size=8, map_refinement=2),
        light=ONE_BOUNCE,
    )
    captured = Runtime(boxes(), context=gl_context).capture(view(), config)
    drawn = captured.vpl_irradiance[captured.valid].astype(np.float64)
    image = drawn_by_formulas(config, captured)
    error = np.sqrt(np.mean((image - drawn) ** 2) / np.mean(drawn**2))
    assert drawn.mean() > 0.01
    assert error < 2e-3, error
