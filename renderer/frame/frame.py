"""One frame, as the diagram has it.

G-buffer ► lights ► RSM ► importance ► VPLs ► cells ► visibility maps ► gather ► filter
► screen-space ► resolve ► tone curve.
With a prior, scene statistics and from them parameters come before the gather.
"""

import moderngl
import numpy as np
from jaxtyping import Float32

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.light_pre_pass import LightPrePass
from vpltune.renderer.frame.passes.auto_parameters import AutoParametersPass
from vpltune.renderer.frame.passes.clustered_discs import LARGEST_COUNT, ClusteredDiscsPass
from vpltune.renderer.frame.passes.direct_light import DirectLightPass
from vpltune.renderer.frame.passes.geometry import GeometryPass
from vpltune.renderer.frame.passes.interleaved_filter import InterleavedFilterPass
from vpltune.renderer.frame.passes.material_resolve import MaterialResolvePass
from vpltune.renderer.frame.passes.reflective_shadow_map import ReflectiveShadowMapPass
from vpltune.renderer.frame.passes.scene_statistics import SceneStatisticsPass
from vpltune.renderer.frame.passes.screen_space_indirect import BLOCK as SCREEN_SPACE_BLOCK
from vpltune.renderer.frame.passes.screen_space_indirect import ScreenSpaceIndirectPass
from vpltune.renderer.frame.passes.tone_mapping import ToneMappingPass
from vpltune.renderer.frame.passes.virtual_point_lights import VirtualPointLightsPass
from vpltune.renderer.frame.passes.vpl_gather import VplGatherPass
from vpltune.renderer.frame.passes.vpl_importance import VplImportancePass, importance_cells
from vpltune.renderer.frame.passes.vpl_visibility_maps import VplVisibilityMapsPass
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.frame.visibility_map_layout import NO_MAPS, VisibilityMapLayout
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms, camera_uniforms
from vpltune.renderer.gpu.parameter_buffer import ParameterBuffer
from vpltune.renderer.gpu.ray_hierarchy import RayHierarchy
from vpltune.renderer.gpu.render_targets import (
    LightAccumulation,
    create_direction_target,
    create_display_target,
    create_gbuffer,
    create_irradiance_target,
    create_pixel_list,
    create_reflective_shadow_map,
)
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.light_faces import (
    FACE_DTYPE,
    LIGHT_DTYPE,
    FaceSnapping,
    LightRecords,
    light_records,
)
from vpltune.renderer.scene.views import View


class Frame:
    """The targets and passes for one image size, one set of light faces and one VPL count.

    Nothing is read back: what a pass makes, the next one reads on the GPU.
    """

    def __init__(
        self,
        context: moderngl.Context,
        scene: SceneBuffers,
        size: tuple[int, int],
        rsm_resolution: int,
        face_count: int,
        vpl_count: int,
        options: RuntimeOptions,
        hierarchy: RayHierarchy | None = None,
        auto_parameters: AutoParametersPass | None = None,
    ):
        self._context = context
        self._scene = scene
        self.size = size
        self.gbuffer = create_gbuffer(context, size)
        self.rsm = create_reflective_shadow_map(context, rsm_resolution, face_count)
        self.direct_irradiance = create_irradiance_target(context, size)
        self.vpl_irradiance = create_irradiance_target(context, size)
        self.near_field_irradiance = create_irradiance_target(context, size)
        self.indirect_irradiance = self.vpl_irradiance
        self._interleaved_irradiance = create_irradiance_target(context, size)
        self.radiance = create_irradiance_target(context, size)
        self.display = create_display_target(context, size)

        self.parameters = ParameterBuffer(context)
        self._lights: moderngl.Buffer | None = None
        self._faces = context.buffer(reserve=max(1, face_count) * FACE_DTYPE.itemsize)
        self._geometry = GeometryPass(context, scene)
        self.light_pre_pass = LightPrePass(context, self.gbuffer, options.light_path)
        self._reflective_shadow_map = ReflectiveShadowMapPass(context, scene)
        self._vpl_importance = VplImportancePass(context, self.rsm)
        cells = importance_cells(self.rsm.face_count)
        self.virtual_point_lights = VirtualPointLightsPass(
            context, self.rsm, vpl_count, options.point_table, options.rsm_filtering, cells
        )
        self._clustered_discs: ClusteredDiscsPass | None = None
        self._direct_light = DirectLightPass(context, rsm_resolution)
        self._hierarchy = hierarchy
        self.vpl_visibility_maps: VplVisibilityMapsPass | None = None
        self._visibility = NO_MAPS
        if hierarchy is not None:
            self._visibility = VisibilityMapLayout.of(options)
            self.vpl_visibility_maps = VplVisibilityMapsPass(context, vpl_count, self._visibility)
        self._auto_parameters = auto_parameters
        self._scene_statistics: SceneStatisticsPass | None = None
        if auto_parameters is not None:
            self._scene_statistics = SceneStatisticsPass(context, self._visibility)
        self.vpls_are_discs = False
        """Of the frame drawn last; else they are points."""
        interleave = options.interleave_for(vpl_count)
        self._vpl_gather = VplGatherPass(context, interleave, self._visibility)
        self._interleaved_filter: InterleavedFilterPass | None = None
        if interleave > 1:
            self._interleaved_direction = create_direction_target(context, size)
            self._pixel_list = create_pixel_list(context, size)
            self._interleaved_filter = InterleavedFilterPass(
                context, interleave, refine=True, relight=True, shadowed=hierarchy is not None
            )
        self._screen_space_indirect = ScreenSpaceIndirectPass(context, size, rsm_resolution, cells)
        self._screen_space_filter = InterleavedFilterPass(context, SCREEN_SPACE_BLOCK, add_base=True)
        self._material_resolve = MaterialResolvePass(context)
        self._tone_mapping = ToneMappingPass(context)

    def draw(
        self,
        view: View,
        records: LightRecords,
        parameters: ArtistParameters,
        table_rotation: tuple[float, float] = (0.0, 0.0),
        lights: DynamicLights | None = None,
    ) -> None:
        """Draw `view` up to the irradiance buffers."""
        accumulated = self._draw_surfaces(view, records, parameters, lights)
        self._draw_indirect(view, parameters, table_rotation, accumulated)

    def draw_indirect_again(
        self, view: View, parameters: ArtistParameters, table_rotation: tuple[float, float]
    ) -> None:
        """Indirect light once more, by other VPLs, of the view as `draw` has left it, without dynamic
        lights."""
        self._context.memory_barrier(self._context.SHADER_IMAGE_ACCESS_BARRIER_BIT)
        self._draw_indirect(view, parameters, table_rotation, None)

    def gather_again(self, view: View, parameters: ArtistParameters) -> None:
        """Gather once more, with other falloff and visibility parameters, from the VPLs and maps as `draw`
        has left them. Dynamic lights are left out of a near field."""
        self._context.memory_barrier(self._context.SHADER_IMAGE_ACCESS_BARRIER_BIT)
        self.parameters.write(parameters)
        self.parameters.bind()
        self._gather_indirect(view, parameters, None)

    def _draw_surfaces(
        self, view: View, records: LightRecords, parameters: ArtistParameters, lights: DynamicLights | None
    ) -> LightAccumulation | None:
        """What camera and lights see, direct light, and how VPLs are to be spread."""
        camera = self.camera(view)
        # Passes write into images that the last frame's may still be reading.
        self._context.memory_barrier(self._context.SHADER_IMAGE_ACCESS_BARRIER_BIT)
        self._bind_lights(records)
        self.parameters.write(parameters)
        self.parameters.bind()
        self._geometry.draw(camera, self.gbuffer)
        accumulated = self.light_pre_pass.draw(camera, lights)
        self._reflective_shadow_map.draw(self.rsm)
        if parameters.density_importance > 0.0:
            self._vpl_importance.draw(camera, self.gbuffer, self.rsm)
        self._vpl_importance.bind()
        self.virtual_point_lights.distribute(self.rsm, records.moment_origin)
        self._direct_light.draw(
            camera, self.gbuffer, self.rsm, len(view.lights), accumulated, self.direct_irradiance
        )
        return accumulated

    def _draw_indirect(
        self,
        view: View,
        parameters: ArtistParameters,
        table_rotation: tuple[float, float],
        accumulated: LightAccumulation | None,
    ) -> None:
        camera = self.camera(view)
        self._place_vpls(table_rotation, parameters.lloyd_iterations)
        self._cast_visibility_maps()
        self._set_auto_parameters(camera)
        self._gather_indirect(view, parameters, accumulated)

    def _gather_indirect(
        self, view: View, parameters: ArtistParameters, accumulated: LightAccumulation | None
    ) -> None:
        camera = self.camera(view)
        self._gather(camera)
        self.indirect_irradiance = self.vpl_irradiance
        # Discs withhold nothing that a near field would have to give back.
        if parameters.screen_space_strength > 0.0 and not self.vpls_are_discs:
            self._add_near_field(camera, len(view.lights), accumulated)
            self.indirect_irradiance = self.near_field_irradiance

    def resolve(self, share: tuple[float, float], exposure: float | None) -> None:
        """From the irradiance buffers to radiance and the display image.

        `share` weighs direct and indirect light; `exposure` None measures it from the image.
        """
        self._material_resolve.draw(
            self.gbuffer, self.direct_irradiance, self.indirect_irradiance, share, self.radiance
        )
        self.tone_map(exposure)

    def tone_map(self, exposure: float | None) -> None:
        """From radiance to the display image."""
        self._tone_mapping.draw(self.radiance, exposure, self.display)

    def read_exposure(self) -> float:
        """The exposure of the display image: waits for the GPU."""
        return self._tone_mapping.read_exposure()

    def read_statistics(self, view: View) -> Float32[np.ndarray, " statistics"]:
        """The statistics of `view`, which has just been drawn: waits for the GPU."""
        if self._scene_statistics is None:
            self._scene_statistics = SceneStatisticsPass(self._context, self._visibility)
        self._scene_statistics.draw(self.camera(view), self.gbuffer, self.virtual_point_lights.count)
        return self._scene_statistics.read()

    def camera(self, view: View) -> CameraUniforms:
        """The view's camera as the shaders know it."""
        return camera_uniforms(view.camera, self.size, self._scene.bounds())

    def _place_vpls(self, table_rotation: tuple[float, float], relaxation: int) -> None:
        vpls = self.virtual_point_lights
        self.vpls_are_discs = relaxation > 0 and vpls.count <= LARGEST_COUNT
        if not self.vpls_are_discs:
            vpls.draw(self.rsm, table_rotation)
            return
        if self._clustered_discs is None:
            self._clustered_discs = ClusteredDiscsPass(self._context, vpls.count)
        vpls.draw(self.rsm, table_rotation, self._clustered_discs.sample_count)
        assert vpls.samples is not None
        self._clustered_discs.draw(vpls.samples, vpls.virtual_point_lights, relaxation)

    def _cast_visibility_maps(self) -> None:
        if self.vpl_visibility_maps is not None and self._hierarchy is not None:
            self._hierarchy.update()
            low, high = self._scene.bounds()
            self.vpl_visibility_maps.draw(self._hierarchy, float(np.linalg.norm(high - low)))

    def _set_auto_parameters(self, camera: CameraUniforms) -> None:
        if self._auto_parameters is not None and self._scene_statistics is not None:
            self._scene_statistics.draw(camera, self.gbuffer, self.virtual_point_lights.count)
            self._auto_parameters.draw()

    def _gather(self, camera: CameraUniforms) -> None:
        count, image, cells = self.virtual_point_lights.count, self.vpl_irradiance, self.vpls_are_discs
        if self._interleaved_filter is None:
            self._vpl_gather.draw(camera, self.gbuffer, count, image, cells=cells)
            return
        self._vpl_gather.draw(
            camera, self.gbuffer, count, self._interleaved_irradiance, self._interleaved_direction, cells
        )
        self._interleaved_filter.draw(
            camera,
            self.gbuffer,
            self._interleaved_irradiance,
            image,
            direction=self._interleaved_direction,
            pixel_list=self._pixel_list,
        )
        self._vpl_gather.refine(camera, self.gbuffer, count, self._pixel_list, image, cells)

    def _add_near_field(
        self, camera: CameraUniforms, light_count: int, accumulated: LightAccumulation | None
    ) -> None:
        self._screen_space_indirect.draw(
            camera,
            self.gbuffer,
            self.direct_irradiance,
            accumulated,
            light_count,
            self.virtual_point_lights.count,
            self._interleaved_irradiance,
        )
        self._screen_space_filter.draw(
            camera,
            self.gbuffer,
            self._interleaved_irradiance,
            self.near_field_irradiance,
            base=self.vpl_irradiance,
        )

    def _bind_lights(self, records: LightRecords) -> None:
        size = max(1, len(records.lights)) * LIGHT_DTYPE.itemsize
        if self._lights is None or self._lights.size < size:
            self._lights = self._context.buffer(reserve=size)
        if len(records.lights):
            self._lights.write(np.ascontiguousarray(records.lights).tobytes())
        if len(records.faces):
            self._faces.write(np.ascontiguousarray(records.faces).tobytes())
        self._lights.bind_to_storage_buffer(buffer_bindings.LIGHTS)
        self._faces.bind_to_storage_buffer(buffer_bindings.RSM_FACES)


def frame_light_records(scene: SceneBuffers, view: View, snapped_cells: int | None = None) -> LightRecords:
    """The view's lights as records for the scene as it stands.

    `snapped_cells` along the side of an orthographic face keep their places in the world while things
    move; None fits the face to the scene.
    """
    if snapped_cells is None:
        return light_records(view.lights, scene.bounds())
    length = float(np.linalg.norm(scene.rest_bounds[1] - scene.rest_bounds[0]))
    return light_records(view.lights, scene.bounds(), FaceSnapping(length, snapped_cells))
