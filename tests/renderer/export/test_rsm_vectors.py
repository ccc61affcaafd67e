"""docs/test_vectors.json on what comes before the gather: RSM texels, L, VPLs, importance, clusters."""

import numpy as np
import pytest
from glsl_results import glsl_results
from vector_file import VECTORS, assert_same_vpls, bind_light, boxes, buffer_of, light_of, vpl_rows

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.capture import octahedral_decode
from vpltune.renderer.frame.passes.clustered_discs import NORMAL_REACH
from vpltune.renderer.frame.passes.reflective_shadow_map import ReflectiveShadowMapPass
from vpltune.renderer.frame.passes.virtual_point_lights import VirtualPointLightsPass
from vpltune.renderer.frame.passes.vpl_importance import DEFINES as IMPORTANCE_DEFINES
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.parameter_buffer import ParameterBuffer
from vpltune.renderer.gpu.render_targets import create_reflective_shadow_map
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms

RSM = VECTORS["rsm"]
SIZE = RSM["face"]["resolution"]
# Normals have 16 bits a channel, and half floats eleven: the reflectances of the file are such.
RTOL = 3e-4


@pytest.fixture
def rsm(gl_context):
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
    bind_light(gl_context, light_of(RSM["light"]))
    return made


def test_the_rsm_pass_stores_this(gl_context):
    """Depth to 1e-5 of it, reflectance to a half float's rounding, at every texel."""
    bind_light(gl_context, light_of(RSM["light"]))
    made = create_reflective_shadow_map(gl_context, SIZE, 1)
    ReflectiveShadowMapPass(gl_context, SceneBuffers(gl_context, boxes())).draw(made)
    depth = np.frombuffer(made.depth.read(alignment=1), np.float32).reshape(SIZE, SIZE)
    normal = np.frombuffer(made.normal.read(alignment=1), np.uint16).reshape(SIZE, SIZE, 2)
    reflectance = np.frombuffer(made.reflectance.read(alignment=1), np.float16).reshape(SIZE, SIZE, 4)
    hit = np.array(RSM["depth"]) > 0.0
    np.testing.assert_allclose(depth, RSM["depth"], rtol=1e-5)
    decoded = octahedral_decode(normal.astype(np.float32) / np.float32(65535.0))
    np.testing.assert_allclose(decoded[hit], np.array(RSM["normal"])[hit], atol=1e-4)
    np.testing.assert_allclose(reflectance[..., :3], RSM["reflectance"], rtol=2e-3, atol=1e-5)


def test_texels(gl_context, rsm):
    found = glsl_results(
        gl_context,
        ["common/rsm.glsl"],
        {**buffer_bindings.DEFINES, "RSM_RESOLUTION": SIZE},
        """
        RsmTexel texel = rsm_texel(ivec2(inputs[first], inputs[first + 1u]));
        result3(to, texel.flux);
        results[to + 3u] = texel.area;
        result3(to + 4u, texel.position_world);
        """,
        np.array([[x, y] for y in range(SIZE) for x in range(SIZE)]),
        7,
        prepare=lambda program: rsm.bind(program, 0),
    ).reshape(SIZE, SIZE, 7)
    np.testing.assert_allclose(found[..., :3], RSM["flux"], rtol=RTOL)
    np.testing.assert_allclose(found[..., 3], RSM["area"], rtol=RTOL)
    np.testing.assert_allclose(found[..., 4:], RSM["position"], atol=3.0 * RTOL)


def placed(context, rsm, parameters: ArtistParameters, filtering=5, rotation=(0.0, 0.0), cells=1):
    """VPLs as the runtime's passes place them, and the frame's statistics."""
    buffer = ParameterBuffer(context)
    buffer.write(parameters)
    buffer.bind()
    vpls = VirtualPointLightsPass(context, rsm, parameters.vpl_count, "r2", filtering, cells)
    vpls.distribute(rsm, tuple(RSM["light"]["position"]))
    vpls.draw(rsm, rotation)
    rows = np.frombuffer(vpls.virtual_point_lights.read(), np.float32).reshape(-1, 12)
    return rows, np.frombuffer(vpls.frame_statistics.read(), np.float32)


def test_flux_and_length_of_the_scene(gl_context, rsm):
    """They do not depend on the density that VPLs are drawn with."""
    _, statistics = placed(gl_context, rsm, ArtistParameters(vpl_count=16, density_exponent=0.5))
    assert statistics[1] == pytest.approx(RSM["total_flux"], rel=RTOL)
    assert statistics[2] == pytest.approx(RSM["scene_length"], rel=RTOL)
    assert statistics[3] == RSM["lit_texels"]


@pytest.mark.parametrize("case", VECTORS["placement"], ids=range(len(VECTORS["placement"])))
def test_placement(gl_context, rsm, case):
    """To 2e-3: what the inversion leaves over is the quotient of two small differences."""
    parameters = ArtistParameters(vpl_count=case["vpl_count"], density_exponent=case["density_exponent"])
    rows, _ = placed(gl_context, rsm, parameters, case["filtering"], tuple(case["rotation"]))
    assert_same_vpls(rows, case["vpls"], 2e-3)


def test_importance(gl_context, rsm):
    """Cells from the RSM, the receivers' estimates, the factors, and VPLs placed by them."""
    case = VECTORS["importance"]
    cells, count = case["cells_of_face"], len(case["position"])
    cell_count = cells**2
    defines = {
        **buffer_bindings.DEFINES,
        **IMPORTANCE_DEFINES,
        "IMPORTANCE_RECEIVERS": count,
        "RSM_RESOLUTION": SIZE,
        "IMPORTANCE_CELLS": cells,
    }
    parameters = ArtistParameters(vpl_count=16, density_importance=case["density_importance"])
    buffer = ParameterBuffer(gl_context)
    buffer.write(parameters)
    buffer.bind()
    made = buffer_of(gl_context, np.zeros((cell_count, 8), np.float32), buffer_bindings.IMPORTANCE_CELLS)
    program = load_compute(gl_context, "vpl_importance/vpl_importance_cells", defines)
    rsm.bind(program, 0)
    program.run(1)
    gl_context.memory_barrier()
    rows = np.frombuffer(made.read(), np.float32).reshape(cells, cells, 8)
    found = {"position": rows[..., 0:3], "flux": rows[..., 3], "normal": rows[..., 4:7], "area": rows[..., 7]}
    for name, values in found.items():
        np.testing.assert_allclose(values, case["cells"][name], rtol=RTOL, atol=3.0 * RTOL, err_msg=name)

    estimate = glsl_results(
        gl_context,
        ["const float PI = 3.14159265358979;", "common/vpl_importance_buffers.glsl"],
        defines,
        f"""
        float sum = 0.0;
        for (int i = 0; i < {cell_count}; ++i) {{
            sum += disc_irradiance(input3(first), input3(first + 3u), importance_cells[i]);
        }}
        results[to] = sum;
        """,
        np.concatenate([np.array(case["position"]), np.array(case["normal"])], axis=1),
        1,
    )
    np.testing.assert_allclose(estimate[:, 0], case["estimate"], rtol=2e-3, atol=1e-9)

    receivers = np.zeros((count, 8), np.float32)
    receivers[:, 0:3], receivers[:, 3] = case["position"], 1.0
    receivers[:, 4:7], receivers[:, 7] = case["normal"], case["estimate"]
    buffer_of(gl_context, receivers, buffer_bindings.IMPORTANCE_RECEIVERS)
    factor = buffer_of(gl_context, np.zeros(cell_count, np.float32), buffer_bindings.VPL_IMPORTANCE)
    for name in ("vpl_importance/vpl_importance", "vpl_importance/vpl_importance_factor"):
        program = load_compute(gl_context, name, defines)
        set_uniforms(program, cell_count=cell_count)
        program.run(1)
        gl_context.memory_barrier()
    factors = np.frombuffer(factor.read(), np.float32).reshape(cells, cells)
    np.testing.assert_allclose(factors, case["factor"], rtol=1e-3)

    rows, _ = placed(gl_context, rsm, parameters, cells=cells)
    assert_same_vpls(rows, case["vpls"], 3e-3)


def test_lloyd_iterations(gl_context):
    """Each iteration from the one before, to 1e-4."""
    case = VECTORS["clusters"]
    samples = vpl_rows(case["samples"])
    defines = {**buffer_bindings.DEFINES, "NORMAL_REACH": NORMAL_REACH}
    owners = load_compute(gl_context, "clustered_discs/clustered_discs_owners", defines)
    discs = load_compute(gl_context, "clustered_discs/clustered_discs", defines)
    set_uniforms(owners, vpl_count=case["vpl_count"], sample_count=len(samples))
    set_uniforms(discs, sample_count=len(samples))
    buffer_of(gl_context, samples, buffer_bindings.VPL_SAMPLES)
    buffer_of(gl_context, np.zeros(len(samples), np.int32), buffer_bindings.VPL_OWNERS)
    buffer_of(gl_context, np.float32([1.0, 1.0, case["scene_length"], 1.0]), buffer_bindings.FRAME_STATISTICS)
    vpls = buffer_of(gl_context, samples[: case["vpl_count"]], buffer_bindings.VIRTUAL_POINT_LIGHTS)
    for step in case["steps"]:
        owners.run(-(-len(samples) // 64))
        gl_context.memory_barrier()
        discs.run(case["vpl_count"])
        gl_context.memory_barrier()
        assert_same_vpls(np.frombuffer(vpls.read(), np.float32).reshape(-1, 12), step, 1e-4)
