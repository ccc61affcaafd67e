"""docs/test_vectors.json on what comes before the gather: RSM texels, L, VPLs, importance, clusters."""

import numpy as np
import pytest
from glsl_results import glsl_results
from point_vpls import point_vpls
from vector_file import (
    PI,
    VECTORS,
    assert_same_vpls,
    boxes,
    buffer_of,
    inputs_of,
    light_buffers,
    light_of,
    vpl_rows,
)

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.parameter_block import parameter_bytes
from vpltune.renderer.frame.disc_samples import DEFINES
from vpltune.renderer.frame.passes.reflective_shadow_map import ReflectiveShadowMapPass
from vpltune.renderer.frame.passes.virtual_point_lights import VirtualPointLightsPass, VplDensityPass
from vpltune.renderer.frame.passes.vpl_importance import DEFINES as IMPORTANCE_DEFINES
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.octahedral import octahedral_decode
from vpltune.renderer.gpu.render_targets import RSM_READS, ReflectiveShadowMap, create_reflective_shadow_map
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.scene_buffers import SceneBuffers

RSM = VECTORS["rsm"]
LIGHT = light_of(RSM["light"])
SIZE = RSM["face"]["resolution"]
# Normals have 16 bits a channel; reflectances are half floats in the file too.
RTOL = 3e-4


@pytest.fixture
def rsm(gl_context) -> ReflectiveShadowMap:
    """The atlas of the one face, holding what the file says."""
    made = create_reflective_shadow_map(gl_context, SIZE, 1)
    normal = np.array(RSM["normal"]).reshape(-1, 3)
    encoded = glsl_results(
        gl_context,
        ["common/octahedral.glsl"],
        {},
        "vec2 e = octahedral_encode(input3(first)); results[to] = e.x; results[to + 1u] = e.y;",
        np.where(normal.any(axis=1, keepdims=True), normal, [0.0, 0.0, 1.0]),
        2,
    )
    reflectance = np.concatenate([np.array(RSM["reflectance"]), np.ones((SIZE, SIZE, 1))], axis=2)
    made.depth.write(np.array(RSM["depth"], np.float32).tobytes())
    made.normal.write(np.round(encoded * 65535.0).astype(np.uint16).tobytes())
    made.reflectance.write(reflectance.astype(np.float16).tobytes())
    return made


@pytest.fixture
def resources(gl_context, rsm) -> Resources:
    """What the density and its importance read."""
    made = Resources(gl_context)
    named = {f"rsm_{name}": getattr(rsm, name) for name in ("depth", "normal", "reflectance")}
    for name, resource in (named | light_buffers(gl_context, LIGHT)).items():
        made[name] = resource
    made["vpl_importance"] = gl_context.buffer(reserve=16)
    return made


def test_the_rsm_pass_stores_this(gl_context):
    """Depth to 1e-5 of it, reflectance to a half float's rounding, at every texel."""
    scene = SceneBuffers(gl_context, boxes())
    made = create_reflective_shadow_map(gl_context, SIZE, 1)
    resources = scene.resources()
    for name, buffer in light_buffers(gl_context, LIGHT).items():
        resources[name] = buffer
    ReflectiveShadowMapPass(resources, scene, made).draw(inputs_of(LIGHT, ArtistParameters()))
    depth = np.frombuffer(made.depth.read(alignment=1), np.float32).reshape(SIZE, SIZE)
    normal = np.frombuffer(made.normal.read(alignment=1), np.uint16).reshape(SIZE, SIZE, 2)
    reflectance = np.frombuffer(made.reflectance.read(alignment=1), np.float16).reshape(SIZE, SIZE, 4)
    hit = np.array(RSM["depth"]) > 0.0
    np.testing.assert_allclose(depth, RSM["depth"], rtol=1e-5)
    decoded = octahedral_decode(normal.astype(np.float32) / np.float32(65535.0))
    np.testing.assert_allclose(decoded[hit], np.array(RSM["normal"])[hit], atol=1e-4)
    np.testing.assert_allclose(reflectance[..., :3], RSM["reflectance"], rtol=2e-3, atol=1e-5)


def test_texels(gl_context, rsm, resources):
    found = glsl_results(
        gl_context,
        ["common/rsm.glsl"],
        {"RSM_RESOLUTION": SIZE},
        """
        RsmTexel texel = rsm_texel(ivec2(inputs[first], inputs[first + 1u]));
        result3(to, texel.flux);
        results[to + 3u] = texel.area;
        result3(to + 4u, texel.position_world);
        """,
        np.array([[x, y] for y in range(SIZE) for x in range(SIZE)]),
        7,
        {name: resources[name] for name in RSM_READS},
        **rsm.uniforms,
    ).reshape(SIZE, SIZE, 7)
    np.testing.assert_allclose(found[..., :3], RSM["flux"], rtol=RTOL)
    np.testing.assert_allclose(found[..., 3], RSM["area"], rtol=RTOL)
    np.testing.assert_allclose(found[..., 4:], RSM["position"], atol=3.0 * RTOL)


def place(resources, rsm, parameters, filtering=5, rotation=(0.0, 0.0), cells=1) -> None:
    """Place VPLs as the runtime's passes do."""
    resources["artist_parameters"] = resources.context.buffer(parameter_bytes(parameters))
    inputs = inputs_of(LIGHT, parameters, rotation)
    VplDensityPass(resources, rsm, cells).draw(inputs)
    VirtualPointLightsPass(resources, rsm, parameters.vpl_count, "r2", filtering, cells).draw(inputs)


def test_flux_and_length_of_the_scene(resources, rsm):
    """They do not depend on the density that VPLs are drawn with."""
    place(resources, rsm, point_vpls(vpl_count=16, density_exponent=0.5))
    statistics = np.frombuffer(resources.read("frame_statistics"), np.float32)
    assert statistics[1] == pytest.approx(RSM["total_flux"], rel=RTOL)
    assert statistics[2] == pytest.approx(RSM["scene_length"], rel=RTOL)
    assert statistics[3] == RSM["lit_texels"]


@pytest.mark.parametrize("case", VECTORS["placement"], ids=range(len(VECTORS["placement"])))
def test_placement(resources, rsm, case):
    """To 2e-3: what the inversion leaves over is the quotient of two small differences."""
    parameters = point_vpls(vpl_count=case["vpl_count"], density_exponent=case["density_exponent"])
    place(resources, rsm, parameters, case["filtering"], tuple(case["rotation"]))
    assert_same_vpls(resources.read("first_vpls"), case["vpls"], 2e-3)


IMPORTANCE = VECTORS["importance"]


@pytest.fixture
def measured(gl_context, resources):
    """Programs of the importance by their stage, for the file's number of cells and receivers."""
    cells, count = IMPORTANCE["cells_of_face"], len(IMPORTANCE["position"])
    defines = {
        **IMPORTANCE_DEFINES,
        "IMPORTANCE_RECEIVERS": count,
        "RSM_RESOLUTION": SIZE,
        "IMPORTANCE_CELLS": cells,
    }
    parameters = ArtistParameters(density_importance=IMPORTANCE["density_importance"])
    resources["artist_parameters"] = gl_context.buffer(parameter_bytes(parameters))
    resources["importance_cells"] = gl_context.buffer(reserve=32 * cells**2)
    receivers = np.zeros((count, 8), np.float32)
    receivers[:, 0:3], receivers[:, 3] = IMPORTANCE["position"], 1.0
    receivers[:, 4:7], receivers[:, 7] = IMPORTANCE["normal"], IMPORTANCE["estimate"]
    resources["importance_receivers"] = buffer_of(gl_context, receivers)
    both = ("importance_cells", "importance_receivers")

    def program(stage: str, reads: tuple[str, ...], writes: str) -> ComputeProgram:
        name = f"vpl_importance/vpl_importance{stage}"
        return ComputeProgram(resources, name, defines, reads=reads, writes=(writes,))

    return defines, {
        "cells": program("_cells", (*RSM_READS, both[1]), both[0]),
        "importance": program("", ("artist_parameters", *RSM_READS, *both), "vpl_importance"),
        "factor": program("_factor", ("artist_parameters", *RSM_READS, *both), "vpl_importance"),
    }


def test_importance(gl_context, resources, rsm, measured):
    """Cells from the RSM, the receivers' estimates, the factors, and VPLs placed by them."""
    defines, programs = measured
    cells = IMPORTANCE["cells_of_face"]
    programs["cells"].dispatch(1, **rsm.uniforms)
    rows = np.frombuffer(resources.read("importance_cells"), np.float32).reshape(cells, cells, 8)
    found = {
        "position": rows[..., 0:3],
        "flux": rows[..., 3],
        "normal": rows[..., 4:7],
        "area": rows[..., 7],
    }
    for name, values in found.items():
        expected = IMPORTANCE["cells"][name]
        np.testing.assert_allclose(values, expected, rtol=RTOL, atol=3.0 * RTOL, err_msg=name)

    estimate = glsl_results(
        gl_context,
        [PI, "common/vpl_importance_buffers.glsl"],
        defines,
        f"""
        float sum = 0.0;
        for (int i = 0; i < {cells**2}; ++i) {{
            sum += disc_irradiance(input3(first), input3(first + 3u), importance_cells[i]);
        }}
        results[to] = sum;
        """,
        np.concatenate([np.array(IMPORTANCE["position"]), np.array(IMPORTANCE["normal"])], axis=1),
        1,
        {"importance_cells": resources["importance_cells"]},
    )
    np.testing.assert_allclose(estimate[:, 0], IMPORTANCE["estimate"], rtol=2e-3, atol=1e-9)

    for name in ("importance", "factor"):
        programs[name].dispatch(1, cell_count=cells**2)
    factors = np.frombuffer(resources.read("vpl_importance"), np.float32).reshape(cells, cells)
    np.testing.assert_allclose(factors, IMPORTANCE["factor"], rtol=1e-3)

    parameters = point_vpls(vpl_count=16, density_importance=IMPORTANCE["density_importance"])
    place(resources, rsm, parameters, cells=cells)
    assert_same_vpls(resources.read("first_vpls"), IMPORTANCE["vpls"], 3e-3)


def test_lloyd_iterations(gl_context):
    """Each iteration from the one before, to 1e-4."""
    case = VECTORS["clusters"]
    samples = vpl_rows(case["samples"])
    resources = Resources(gl_context)
    resources["vpl_samples"] = buffer_of(gl_context, samples)
    resources["vpl_members"] = gl_context.buffer(bytes(4 * case["vpl_count"] * -(-len(samples) // 32)))
    resources["frame_statistics"] = buffer_of(gl_context, np.float32([1.0, 1.0, case["scene_length"], 1.0]))
    resources["virtual_point_lights"] = buffer_of(gl_context, samples[: case["vpl_count"]])
    owners = ComputeProgram(
        resources,
        "clustered_discs/clustered_discs_owners",
        DEFINES,
        reads=("frame_statistics", "vpl_samples", "virtual_point_lights"),
        writes=("vpl_members",),
    )
    discs = ComputeProgram(
        resources,
        "clustered_discs/clustered_discs",
        DEFINES,
        reads=("frame_statistics", "vpl_samples"),
        writes=("virtual_point_lights", "vpl_members"),
    )
    for step in case["steps"]:
        groups = -(-len(samples) // 64)
        owners.dispatch(groups, vpl_count=case["vpl_count"], sample_count=len(samples))
        discs.dispatch(case["vpl_count"], sample_count=len(samples))
        assert_same_vpls(resources.read("virtual_point_lights"), step, 1e-4)
