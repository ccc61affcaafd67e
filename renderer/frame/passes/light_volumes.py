"""Light volumes (Engel 2008, "Light Pre-Pass"): proxy meshes, one instanced draw for each kind of light.

A pixel can be lit only where it lies in front of the far side of the volume: back faces are drawn, against
the scene's own depth, so that a camera inside a volume is served too.

Sums are blended in full floats. In half floats every blend rounds the whole sum, by up to 2⁻¹¹ of it: a
thousand dim lights over a pixel could be lost.
"""

import math

import moderngl
import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.gpu.gpu_program import RasterProgram
from vpltune.renderer.gpu.render_targets import GBUFFER_READS, create_irradiance_target
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.scene.dynamic_lights import MIN_DISTANCE

AZIMUTHS = 12
"""Vertices round the axis of a cone's proxy. A choice."""
RINGS = 2
"""Rings of them from the axis to the rim. A choice."""
CONE_DEFINES = {
    "AZIMUTH_COSINE": math.cos(math.pi / AZIMUTHS),
    # A facet between rings spans at most 90°/RINGS by 360°/AZIMUTHS of the unit sphere: half its diagonal is
    # how far its corners are from where it comes nearest to the centre.
    "CIRCUMSCRIBED": 1.0 / math.cos(math.hypot(math.pi / 4.0 / RINGS, math.pi / AZIMUTHS)),
}


class LightVolumesPass:
    """G-buffer, lights → light accumulation, in two draws."""

    accumulation = "volume_light_accumulation"
    """The resource that it writes."""

    def __init__(self, resources: Resources):
        self._context = context = resources.context
        self._resources = resources
        depth = resources.texture("gbuffer_depth")
        target = resources[self.accumulation] = create_irradiance_target(context, depth.size)
        self._cleared = context.framebuffer([target])
        self._framebuffer = context.framebuffer([target], depth)
        # The shader reads the same depth that is tested: allowed as long as nothing writes it.
        self._framebuffer.depth_mask = False
        self._points = self._volumes(sphere_proxy(), cone=False)
        self._spots = self._volumes(cone_proxy(), cone=True)

    def draw(self, inputs: FrameInputs) -> None:
        """Accumulate the lights."""
        context, lights = self._context, inputs.dynamic_lights
        assert lights is not None, "a pre-pass without lights draws nothing"
        self._cleared.use()
        self._cleared.clear(0.0, 0.0, 0.0, 0.0)
        self._framebuffer.use()
        context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
        # Depth is reversed: "less" is farther than the surface.
        context.depth_func = "<="
        context.cull_face = "front"
        context.blend_func = moderngl.ONE, moderngl.ONE
        for (program, volumes), first, count in (
            (self._points, 0, lights.point_count),
            (self._spots, lights.point_count, lights.spot_count),
        ):
            if not count:
                continue
            program.bind(
                **inputs.camera.uniforms, first_light=first, accumulation_unit=lights.accumulation_unit
            )
            volumes.render(moderngl.TRIANGLES, instances=count)

    def _volumes(
        self, proxy: tuple[Float64[np.ndarray, "vertices 3"], Int64[np.ndarray, "triangles 3"]], cone: bool
    ) -> tuple[RasterProgram, moderngl.VertexArray]:
        vertices, triangles = proxy
        context = self._context
        program = RasterProgram(
            self._resources,
            "dynamic_lights/light_volumes",
            {**CONE_DEFINES, "MIN_DISTANCE": MIN_DISTANCE, "CONE": cone},
            reads=(*GBUFFER_READS, "dynamic_lights"),
        )
        array = context.vertex_array(
            program.program,
            [(context.buffer(vertices.astype("f4").tobytes()), "3f", "in_position")],
            index_buffer=context.buffer(triangles.astype("u4").tobytes()),
            index_element_size=4,
        )
        return program, array


def sphere_proxy() -> tuple[Float64[np.ndarray, "vertices 3"], Int64[np.ndarray, "triangles 3"]]:
    """An icosahedron with each face split in four, around the unit sphere; faces wind outwards."""
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    corners = [(0.0, s, t * golden) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    vertices = np.array([np.roll(corner, shift) for corner in corners for shift in range(3)])
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    edge = np.linalg.norm(vertices - vertices[0], axis=1)[1:].min() * 1.01
    near = np.linalg.norm(vertices[:, None] - vertices[None], axis=2) < edge
    faces = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    split = []
    for a, b, c in ([vertices[i] for i in face] for face in faces):
        if np.linalg.det([a, b, c]) < 0.0:
            b, c = c, b
        ab, bc, ca = ((p + q) / np.linalg.norm(p + q) for p, q in ((a, b), (b, c), (c, a)))
        split += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    points = np.array(split)
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    nearest_face = (normals * points[:, 0]).sum(axis=1).min()
    unique, index = np.unique(np.round(points.reshape(-1, 3), 12), axis=0, return_inverse=True)
    return unique / nearest_face, index.reshape(-1, 3).astype(np.int64)


def cone_proxy() -> tuple[Float64[np.ndarray, "vertices 3"], Int64[np.ndarray, "triangles 3"]]:
    """Apex, rings around the axis and the pole, as shares of the polar angle; faces wind outwards.

    Each row is (share of the polar angle or −1 for the apex, cos azimuth, sin azimuth).
    """
    azimuth = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    vertices = [(-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    for ring in range(1, RINGS + 1):
        vertices += [(ring / RINGS, math.cos(a), math.sin(a)) for a in azimuth]
    triangles = []
    outermost = 2 + (RINGS - 1) * AZIMUTHS
    for i in range(AZIMUTHS):
        j = (i + 1) % AZIMUTHS
        triangles += [(1, 2 + i, 2 + j), (0, outermost + j, outermost + i)]
        for ring in range(RINGS - 1):
            inner, outer = 2 + ring * AZIMUTHS, 2 + (ring + 1) * AZIMUTHS
            triangles += [(inner + i, outer + i, outer + j), (inner + i, outer + j, inner + j)]
    return np.array(vertices), np.array(triangles, np.int64)
