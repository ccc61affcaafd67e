"""VPLs as the 2010 study had them: RSM read back, a Poisson-disc pattern on the CPU, a draw per VPL."""

from dataclasses import dataclass

import moderngl
import numpy as np
from jaxtyping import Float16, Float32, UInt16

from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.frame.point_table import poisson_disc
from vpltune.renderer.gpu.gpu_program import RasterProgram
from vpltune.renderer.gpu.octahedral import octahedral_decode
from vpltune.renderer.gpu.render_targets import GBUFFER_READS, create_irradiance_target
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.shader_library import set_uniforms
from vpltune.renderer.scene.light_faces import LightRecords
from vpltune.renderer.techniques.gathered_vpls import VPL_DTYPE

MIN_COSINE = 0.02
"""As RSM_MIN_COSINE of shaders/common/rsm.glsl."""


@dataclass(frozen=True, eq=False)
class RsmTexels:
    """An RSM atlas on the CPU, as it is stored; row 0 at the bottom."""

    depth: Float32[np.ndarray, "rows columns"]
    normal: UInt16[np.ndarray, "rows columns 2"]
    reflectance: Float16[np.ndarray, "rows columns 4"]


class VplsReadback:
    """RSM of a drawn frame → irradiance, with the RSM read back on the way."""

    def __init__(self, frame: Frame, count: int, seed: int = 0):
        self._frame = frame
        self._points = poisson_disc(count, seed)
        self._resources = resources = frame.resources.child()
        context = resources.context
        resources["vpl_irradiance"] = target = create_irradiance_target(context, frame.setup.size)
        self._program = RasterProgram(
            resources, "techniques/vpls_readback", reads=(*GBUFFER_READS, "frame_statistics")
        )
        self._triangle = context.vertex_array(self._program.program, [])
        self._framebuffer = context.framebuffer([target])

    def read(self) -> RsmTexels:
        """The whole RSM, which waits until the GPU has drawn it."""
        rsm = self._frame.rsm
        columns, rows = rsm.depth.size
        return RsmTexels(
            np.frombuffer(rsm.depth.read(), np.float32).reshape(rows, columns),
            np.frombuffer(rsm.normal.read(), np.uint16).reshape(rows, columns, 2),
            np.frombuffer(rsm.reflectance.read(), np.float16).reshape(rows, columns, 4),
        )

    def place(self, texels: RsmTexels, records: LightRecords) -> np.ndarray:
        """The texels under the pattern: [count] of `VPL_DTYPE`.

        Uniform over texels, so each of N stands for texels/N of them. Twin: `rsm_texel` of
        shaders/common/rsm.glsl.
        """
        rsm = self._frame.rsm
        columns, rows = rsm.depth.size
        depth, normal, reflectance = texels.depth, texels.normal, texels.reflectance
        column, row = (self._points * np.array([columns, rows])).astype(int).T
        tile = row // rsm.resolution * rsm.columns + column // rsm.resolution
        lit = (tile < rsm.face_count) & (depth[row, column] > 0.0)
        vpls = np.zeros(len(self._points), VPL_DTYPE)
        vpls["normal"][:] = (0.0, 0.0, 1.0)
        column, row, tile = column[lit], row[lit], tile[lit]
        faces = records.faces[tile]
        position, to_light, factor, area = _unprojected(
            faces,
            np.stack([column, row], axis=1) % rsm.resolution,
            rsm.resolution,
            depth[row, column].astype(np.float64),
        )
        normals = octahedral_decode(normal[row, column].astype(np.float32) / np.float32(65535.0))
        share = columns * rows / len(self._points)
        area = area / np.maximum((normals * to_light).sum(axis=1), MIN_COSINE) * share
        intensity = records.lights["intensity_cos_outer"][faces["light"], :3]
        vpls["position"][lit] = position
        vpls["normal"][lit] = normals
        vpls["area"][lit] = area
        vpls["footprint"][lit] = np.sqrt(area / np.pi)
        vpls["flux"][lit] = intensity * reflectance[row, column, :3] * (factor * share)[:, None]
        return vpls

    def draw(self, inputs: FrameInputs, vpls: np.ndarray) -> Resources:
        """One additive full-screen draw for each VPL; `vpl_irradiance` of what is returned is the result."""
        context, parameters = self._resources.context, inputs.parameters
        self._framebuffer.use()
        self._framebuffer.clear()
        context.enable_only(moderngl.BLEND)
        context.blend_func = (moderngl.ONE, moderngl.ONE)
        self._program.bind(
            **inputs.camera.uniforms,
            intensity=parameters.intensity,
            falloff_footprint=parameters.falloff_footprint,
            extinction_coefficient=parameters.extinction_coefficient,
        )
        for vpl in vpls:
            set_uniforms(
                self._program.program,
                position_footprint=(*vpl["position"].tolist(), float(vpl["footprint"])),
                normal_area=(*vpl["normal"].tolist(), float(vpl["area"])),
                flux=tuple(vpl["flux"].tolist()),
            )
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
        return self._resources


def _unprojected(
    faces: np.ndarray, texel: np.ndarray, resolution: int, depth: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Position, direction to the light, solid angle (or area across the beam), and area square to the ray."""
    extent = faces["extent"].astype(np.float64)
    orthographic = faces["orthographic"] != 0
    near_or_range = faces["near_or_range"].astype(np.float64)
    ndc = (texel + 0.5) * (2.0 / resolution) - 1.0
    side = extent * (2.0 / resolution)
    view_depth = np.where(orthographic, (1.0 - depth) * near_or_range, near_or_range / depth)
    scale = np.where(orthographic, 1.0, view_depth)
    position_face = np.concatenate([ndc * extent * scale[:, None], -view_depth[:, None]], axis=1)
    distance = np.linalg.norm(position_face, axis=1)
    # |ray| at unit depth; an orthographic ray runs along the axis.
    ray_length = np.where(orthographic, 1.0, distance / view_depth)
    factor = side[:, 0] * side[:, 1] / ray_length**3
    area = factor * np.where(orthographic, 1.0, distance**2)
    axis = np.array([0.0, 0.0, 1.0])
    to_light_face = np.where(orthographic[:, None], axis, -position_face / distance[:, None])
    matrix = faces["light_to_world"].transpose(0, 2, 1).astype(np.float64)
    position = np.einsum("nij,nj->ni", matrix[:, :3, :3], position_face) + matrix[:, :3, 3]
    to_light = np.einsum("nij,nj->ni", matrix[:, :3, :3], to_light_face)
    return position, to_light, factor, area
