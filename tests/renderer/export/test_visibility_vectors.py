"""docs/test_vectors.json on visibility maps and on the display: shaders and surrogate see as it says."""

import jax.numpy as jnp
import numpy as np
import pytest
from glsl_results import glsl_results
from vector_file import PI, VECTORS, boxes, buffer_of, inputs_of, light_of, vpl_rows

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.passes.vpl_visibility_maps import VplVisibilityMapsPass
from vpltune.renderer.frame.visibility_map_layout import VISIBILITY_CORNER_MASK, VisibilityMapLayout
from vpltune.renderer.gpu.octahedral import octahedral_decode
from vpltune.renderer.gpu.ray_hierarchy import RayHierarchy
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_visibility import (
    MapTexels,
    VisibilityParameters,
    hemi_octahedral_decode,
    hemisphere_frame,
    vpl_visibility,
)

CASE = VECTORS["visibility"]
MAP = {name: np.array(values) for name, values in CASE["map"].items()}
SIZE, REFINEMENT = len(MAP["end"]), MAP["block_end"].shape[1]
LENGTH = CASE["scene_length"]
LOOKUP = [PI, "common/virtual_point_lights.glsl", "common/vpl_visibility.glsl"]
LAYOUT = VisibilityMapLayout(SIZE, REFINEMENT)
DEFINES = LAYOUT.defines
VPL = {name: [CASE["vpl"][name]] for name in ("position", "normal", "footprint")} | {
    "flux": [[1.0, 1.0, 1.0]]
}


def test_frames(gl_context):
    normals = np.array([case["normal"] for case in CASE["frames"]])
    expected = np.array([case["rows"] for case in CASE["frames"]])
    found = glsl_results(
        gl_context,
        ["common/hemi_octahedral.glsl"],
        DEFINES,
        "mat3 frame = hemisphere_frame(input3(first));"
        "for (uint i = 0u; i < 3u; ++i) { result3(to + 3u * i, frame[i]); }",
        normals,
        9,
    )
    np.testing.assert_allclose(found.reshape(-1, 3, 3), expected, atol=1e-6)
    np.testing.assert_allclose(hemisphere_frame(jnp.asarray(normals, jnp.float32)), expected, atol=1e-6)


def test_axes_of_texels(gl_context):
    texels = np.array([[column, row] for row in range(4) for column in range(4)], np.float64)
    found = glsl_results(
        gl_context,
        LOOKUP,
        DEFINES,
        "result3(to, visibility_axis(ivec2(inputs[first], inputs[first + 1u]), 4));",
        texels,
        3,
    )
    expected = np.array(CASE["axes_of_4x4"]).reshape(-1, 3)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    places = jnp.asarray((texels + 0.5) * 0.5 - 1.0, jnp.float32)
    np.testing.assert_allclose(hemi_octahedral_decode(places), expected, atol=1e-6)


@pytest.mark.parametrize("pair", range(len(CASE["bias_softness"])))
def test_overlaps_and_what_passes_them(gl_context, pair):
    bias, softness = CASE["bias_softness"][pair]
    names = ("end", "end_normal", "receiver", "receiver_normal")
    found = glsl_results(
        gl_context,
        LOOKUP,
        DEFINES,
        f"""
        MetSurface met = MetSurface(input3(first), input3(first + 3u));
        float overlap = surface_overlap(met, input3(first + 6u), input3(first + 9u));
        results[to] = overlap;
        results[to + 1u] = 1.0 - clamp((overlap - {bias}) / {softness}, 0.0, 1.0);
        """,
        np.array([np.concatenate([case[name] for name in names]) for case in CASE["overlaps"]]),
        2,
    )
    np.testing.assert_allclose(found[:, 0], [case["overlap"] for case in CASE["overlaps"]], atol=1e-6)
    # An overlap is off by 1e-7 at most, of which the softness makes 1e-4.
    np.testing.assert_allclose(
        found[:, 1], [case["seen_share"][pair] for case in CASE["overlaps"]], atol=2e-4
    )


def packed(context, end: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """[texels, 2] of uint32: distances and normals as shaders pack them."""
    rows = np.concatenate([np.linalg.norm(end, axis=-1)[..., None], normal], axis=-1).reshape(-1, 4)
    found = glsl_results(
        context,
        LOOKUP,
        DEFINES,
        "uvec2 entry = visibility_texel(inputs[first], input3(first + 1u));"
        "results[to] = uintBitsToFloat(entry.x); results[to + 1u] = uintBitsToFloat(entry.y);",
        rows,
        2,
    )
    return found.view(np.uint32)


@pytest.mark.parametrize("pair", range(len(CASE["bias_softness"])))
def test_shaders_see_this(gl_context, pair):
    """To 2e-3: normals in maps have 16 bits a channel."""
    bias, softness = CASE["bias_softness"][pair]
    texels = packed(gl_context, MAP["end"], MAP["normal"]).copy()
    blocks = MAP["block"].ravel()
    texels[:, 0] |= MAP["corner"].ravel().astype(np.uint32)
    texels[blocks >= 0, 0] = 0x80000001
    texels[blocks >= 0, 1] = blocks[blocks >= 0]
    maps = {
        "visibility_maps": buffer_of(gl_context, texels),
        "visibility_details": buffer_of(
            gl_context, packed(gl_context, MAP["block_end"], MAP["block_normal"])
        ),
    }
    numbers = {name: ", ".join(map(str, np.ravel(values))) for name, values in VPL.items()}
    found = glsl_results(
        gl_context,
        LOOKUP,
        DEFINES,
        f"""
        VirtualPointLight vpl = VirtualPointLight(
            vec4({numbers["position"]}, {numbers["footprint"]}), vec4({numbers["normal"]}, 0.0), vec4(1.0));
        results[to] = vpl_visibility(
            input3(first), input3(first + 3u), vpl, 0, {LENGTH}, VisibilityParameters({bias}, {softness}));
        """,
        np.array([case["position"] + case["normal"] for case in CASE["receivers"]]),
        1,
        maps,
    )
    np.testing.assert_allclose(
        found[:, 0], [case["seen_share"][pair] for case in CASE["receivers"]], atol=2e-3
    )


@pytest.mark.parametrize("pair", range(len(CASE["bias_softness"])))
def test_the_surrogate_sees_this(pair):
    bias, softness = CASE["bias_softness"][pair]

    def single(values, scale=1.0) -> jnp.ndarray:
        return jnp.asarray(np.array(values) / scale, jnp.float32)

    start = np.where(MAP["block"] >= 0, SIZE**2 + MAP["block"] * REFINEMENT**2, -1)
    joined = [
        single(np.concatenate([MAP[name].reshape(-1, 3), MAP[f"block_{name}"].reshape(-1, 3)]))
        for name in ("end", "normal")
    ]
    seen = vpl_visibility(
        Receivers(
            single([case["position"] for case in CASE["receivers"]], LENGTH),
            single([case["normal"] for case in CASE["receivers"]]),
        ),
        VirtualPointLights(
            single(VPL["position"], LENGTH),
            single(VPL["normal"]),
            single(VPL["footprint"], LENGTH),
            single(VPL["flux"], LENGTH**2),
        ),
        MapTexels(
            *joined,
            jnp.asarray(MAP["corner"][None], jnp.int32),
            jnp.asarray(start[None], jnp.int32),
            REFINEMENT,
        ),
        VisibilityParameters(jnp.float32(bias), jnp.float32(softness)),
    )
    np.testing.assert_allclose(
        np.asarray(seen)[:, 0], [case["seen_share"][pair] for case in CASE["receivers"]], atol=2e-3
    )


def test_maps_are_cast_like_this(gl_context):
    """Distances to 1e-4, normals to 16 bits; the same corners, silhouettes and finer rays."""
    scene = SceneBuffers(gl_context, boxes())
    hierarchy = RayHierarchy(gl_context, boxes(), scene)
    resources = scene.resources()
    hierarchy.add_to(resources)
    resources["virtual_point_lights"] = buffer_of(gl_context, vpl_rows(VPL))
    resources["frame_statistics"] = buffer_of(gl_context, np.float32([1.0, 1.0, LENGTH, 1.0]))
    # More boxes than there is room for: every texel is cast.
    resources["receiver_bounds"] = buffer_of(gl_context, np.uint32([1, 0, 0, 0]))
    light = light_of(VECTORS["rsm"]["light"])
    VplVisibilityMapsPass(resources, 1, LAYOUT, hierarchy).draw(inputs_of(light, ArtistParameters()))
    texels = np.frombuffer(resources.read("visibility_maps"), np.uint32).reshape(SIZE, SIZE, 2)
    refined = texels[..., 0] >> 31 != 0
    np.testing.assert_array_equal(refined, MAP["block"] >= 0)
    np.testing.assert_array_equal(texels[..., 0] & VISIBILITY_CORNER_MASK, MAP["corner"])
    assert_met(texels[~refined], MAP["end"][~refined], MAP["normal"][~refined])
    # Blocks lie in the order in which invocations came to them.
    details = resources.read("visibility_details")
    blocks = np.frombuffer(details, np.uint32).reshape(-1, REFINEMENT, REFINEMENT, 2)
    assert_met(blocks[texels[refined][:, 1]], MAP["block_end"], MAP["block_normal"])


def assert_met(texels: np.ndarray, end: np.ndarray, normal: np.ndarray) -> None:
    distance = np.linalg.norm(end, axis=-1)
    np.testing.assert_allclose(texels[..., 0].copy().view(np.float32), distance, rtol=1e-4)
    halves = np.stack([texels[..., 1] & 0xFFFF, texels[..., 1] >> 16], axis=-1)
    decoded = octahedral_decode(halves.astype(np.float32) / np.float32(65535.0))
    np.testing.assert_allclose(decoded, normal, atol=1e-4)


def test_tone_curve(gl_context):
    case = VECTORS["display"]
    found = glsl_results(
        gl_context,
        ["common/tone_curve.glsl"],
        {},
        "result3(to, srgb_encode(clamp(tone_curve(input3(first)), 0.0, 1.0)));",
        np.array(case["exposed_radiance"], np.float64),
        3,
    )
    np.testing.assert_allclose(found, case["srgb"], atol=1e-4)
    np.testing.assert_allclose(np.floor(255.0 * found + 0.5), case["bytes"], atol=1.0)
