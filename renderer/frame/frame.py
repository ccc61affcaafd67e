"""One frame, as the diagram in ARCHITECTURE.md has it: an ordered list of passes.

A pass declares what it reads and writes by name; nothing is read back on the way.
"""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace

import moderngl
import numpy as np
from jaxtyping import Float32

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.auto_prior import AutoPrior
from vpltune.renderer.config.parameter_block import BLOCK_BYTES, parameter_bytes, unpack_parameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.frame_timing import PassClock
from vpltune.renderer.frame.light_pre_pass import LightPrePass
from vpltune.renderer.frame.passes.auto_parameters import AutoParametersPass
from vpltune.renderer.frame.passes.blended_shadow import SHADOW_READS, BlendedShadowPass
from vpltune.renderer.frame.passes.clustered_discs import ClusteredDiscsPass
from vpltune.renderer.frame.passes.direct_light import DirectLightPass
from vpltune.renderer.frame.passes.geometry import GeometryPass
from vpltune.renderer.frame.passes.glowing_surfaces import GlowingSurfacesPass
from vpltune.renderer.frame.passes.interleaved_filter import InterleavedFilterPass, NearFieldFilterPass
from vpltune.renderer.frame.passes.joined_vpls import JoinedVplsPass
from vpltune.renderer.frame.passes.light_walks import LightWalksPass, walk_table
from vpltune.renderer.frame.passes.material_resolve import MaterialResolvePass
from vpltune.renderer.frame.passes.receiver_bounds import ReceiverBoundsPass
from vpltune.renderer.frame.passes.reflective_shadow_map import ReflectiveShadowMapPass
from vpltune.renderer.frame.passes.scene_statistics import SceneStatisticsPass
from vpltune.renderer.frame.passes.screen_space_indirect import BLOCK as NEAR_FIELD_BLOCK
from vpltune.renderer.frame.passes.screen_space_indirect import ScreenSpaceIndirectPass
from vpltune.renderer.frame.passes.sky_light import SkyLightPass
from vpltune.renderer.frame.passes.tone_mapping import ToneMappingPass
from vpltune.renderer.frame.passes.virtual_point_lights import VirtualPointLightsPass, VplDensityPass
from vpltune.renderer.frame.passes.vpl_gather import (
    GatherGlowingPass,
    GatherListedPixelsPass,
    VplGatherPass,
)
from vpltune.renderer.frame.passes.vpl_importance import VplImportancePass, importance_cells
from vpltune.renderer.frame.passes.vpl_visibility_maps import VplVisibilityMapsPass
from vpltune.renderer.frame.rsm_resolution import rsm_resolution
from vpltune.renderer.frame.runtime_options import DEFAULT_OPTIONS, RuntimeOptions
from vpltune.renderer.frame.visibility_map_layout import VisibilityMapLayout
from vpltune.renderer.frame.vpl_pools import DiscPool, VplPools
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms, camera_uniforms
from vpltune.renderer.gpu.glowing_triangles import GlowingTriangles
from vpltune.renderer.gpu.ray_hierarchy import RayHierarchy
from vpltune.renderer.gpu.render_targets import (
    create_direction_target,
    create_display_target,
    create_gbuffer,
    create_irradiance_target,
    create_pixel_list,
    create_reflective_shadow_map,
)
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.scene.light_faces import (
    FACE_DTYPE,
    LIGHT_DTYPE,
    LightRecords,
    face_count,
    light_records,
)
from vpltune.renderer.scene.scene import Light
from vpltune.renderer.scene.sky_lights import SkyLights
from vpltune.renderer.scene.sun_faces import SunGrid
from vpltune.renderer.scene.views import View


@dataclass(frozen=True)
class FrameSetup:
    """What a frame's targets and programs depend on: drawings with equal set-ups share a frame."""

    size: tuple[int, int]
    """Width and height in pixels."""
    face_count: int
    rsm_resolution: int
    importance_cells: int
    pools: VplPools
    bounces: int | None
    """Reflections before light reaches the receiver; None for all."""
    interleave: int
    sky_count: int
    """`light.sky_lights` of the config; 0 without a sky."""
    maps: VisibilityMapLayout
    prior: AutoPrior | None
    adaptation_frames: float

    @classmethod
    def of(
        cls,
        view: View,
        config: TunedConfig,
        nested_faces: int,
        *,
        glows: bool,
        sky_lights: int = 0,
        options: RuntimeOptions = DEFAULT_OPTIONS,
    ) -> "FrameSetup":
        """The set-up that draws `view` with `config`.

        Args:
            view: gives size and lights.
            config: gives all else.
            nested_faces: of each sun in the scene.
            glows: whether a surface of the scene glows.
            sky_lights: lights that stand for the scene's sky.
            options: give the walks and the share of VPLs of later light.
        """
        count, bounces = config.parameters.vpl_count, config.light.most_bounces
        has_lights = bool(view.lights) or sky_lights > 0
        pools = VplPools.of(
            count,
            has_lights=has_lights,
            glows=glows,
            bounces=bounces,
            walks=options.walks,
            later_share=options.later_share,
        )
        return cls(
            size=view.size,
            face_count=face_count(view.lights, nested_faces) + sky_lights,
            rsm_resolution=rsm_resolution(view.lights, config.quality, sky_lights),
            importance_cells=importance_cells(face_count(view.lights, nested_faces=0) + sky_lights),
            pools=pools,
            bounces=bounces,
            interleave=config.quality.interleave_for(pools.reflected, view.size),
            sky_count=config.light.sky_lights if sky_lights else 0,
            maps=VisibilityMapLayout.of(config),
            prior=config.auto,
            adaptation_frames=config.quality.adaptation_frames,
        )


class Frame:
    """The targets and passes of one `FrameSetup`; `resources` holds them by name."""

    def __init__(
        self,
        scene: SceneBuffers,
        setup: FrameSetup,
        options: RuntimeOptions,
        hierarchy: RayHierarchy | None,
        glowing: GlowingTriangles | None,
        sky: SkyLights,
    ):
        self.setup = setup
        self.scene = scene
        self.resources = scene.resources()
        self._make_targets()
        resources, rsm = self.resources, self.rsm
        if hierarchy is not None:
            hierarchy.add_to(resources)
        cells = setup.importance_cells
        self.light_pre_pass = LightPrePass(resources, options.light_path)
        self._seen: list[FramePass] = [
            GeometryPass(resources, scene, self.gbuffer),
            self.light_pre_pass,
            ReflectiveShadowMapPass(resources, scene, rsm),
            VplImportancePass(resources, rsm, cells),
            VplDensityPass(resources, rsm, cells),
        ]
        """What camera and lights see, direct light, and the density of VPLs."""
        shadow_reads = SHADOW_READS if scene.has_blended else ()
        if scene.has_blended:
            self._seen.append(BlendedShadowPass(resources, scene, rsm))
        punctual = "direct_irradiance" if glowing is None else "punctual_irradiance"
        along_rays = len(sky.lights) - sky.narrow
        lamps = "lamp_irradiance" if along_rays else punctual
        self._seen.append(DirectLightPass(resources, rsm, lamps, along_rays, shadow_reads))
        if along_rays:
            assert hierarchy is not None, "light of the sky comes along rays"
            self._seen.append(SkyLightPass(resources, hierarchy, sky, punctual))
        self._placed: list[FramePass] = self._placing_passes(options, hierarchy, glowing)
        """VPLs, what they see, and the parameters that a prior sets from it."""
        if setup.maps.size:
            assert hierarchy is not None, "visibility maps are cast as rays"
            self._seen.append(ReceiverBoundsPass(resources))
            self._placed.append(VplVisibilityMapsPass(resources, setup.pools.total, setup.maps, hierarchy))
        self._statistics: SceneStatisticsPass | None = None
        if setup.prior is not None:
            self._statistics = SceneStatisticsPass(resources, setup.maps)
            self._placed.append(self._statistics)
            self._placed.append(AutoParametersPass(resources, setup.prior, setup.adaptation_frames))
        near_field = ScreenSpaceIndirectPass(resources, rsm, cells, punctual)
        self._gathered: list[FramePass] = [
            *([] if glowing is None else [GatherGlowingPass(resources, setup.maps, setup.pools)]),
            VplGatherPass(resources, setup.interleave, setup.maps, setup.pools),
            *self._interleaved_passes(),
            near_field,
            NearFieldFilterPass(resources, NEAR_FIELD_BLOCK, near_field.wanted),
        ]
        """Light from VPLs."""
        self._near_field_wanted = near_field.wanted
        self._material_resolve = MaterialResolvePass(
            resources, glows=scene.glows, shows_sky="environment_map" in resources
        )
        self._tone_mapping = ToneMappingPass(resources)

    def draw(self, inputs: FrameInputs, clock: PassClock | None = None) -> None:
        """Draw up to the irradiance buffers; `clock` times each pass."""
        self._camera = inputs.camera
        self._write_lights(inputs.records)
        self._write_parameters(inputs.parameters)
        self._run([*self._seen, *self._placed, *self._gathered], inputs, clock)

    def draw_indirect_again(self, inputs: FrameInputs) -> None:
        """Place other VPLs and gather from them, in the view as `draw` left it. Dynamic lights stay as drawn
        in the direct light, and are left out of a near field."""
        self._write_parameters(inputs.parameters)
        self._run([*self._placed, *self._gathered], replace(inputs, dynamic_lights=None), None)

    def gather_again(self, inputs: FrameInputs) -> None:
        """Gather with other falloff and visibility parameters, from the VPLs and maps as `draw` left them.
        Dynamic lights as in `draw_indirect_again`."""
        self._write_parameters(inputs.parameters)
        self._run(self._gathered, replace(inputs, dynamic_lights=None), None)

    def resolve(
        self, share: tuple[float, float], exposure: float | None, clock: PassClock | None = None
    ) -> None:
        """From the irradiance buffers to radiance and the display image.

        `share` weighs direct and indirect light; `exposure` None measures it from the image.
        """
        with _timed(clock, self._material_resolve.name):
            self._material_resolve.draw(share, self._camera)
        with _timed(clock, self._tone_mapping.name):
            self._tone_mapping.draw(exposure)

    def tone_map(self, exposure: float | None) -> None:
        """From radiance to the display image."""
        self._tone_mapping.draw(exposure)

    def texture(self, name: str) -> moderngl.Texture:
        """A target by its name, for reading back."""
        return self.resources.texture(name)

    def read_exposure(self) -> float:
        """What radiance was multiplied by for display: waits for the GPU."""
        return float(np.frombuffer(self.resources.read("exposure", 4), np.float32)[0])

    def read_parameters(self) -> ArtistParameters:
        """What the gather read, where a prior set some of it: waits for the GPU."""
        return unpack_parameters(self.resources.read("artist_parameters"))

    def read_statistics(self, inputs: FrameInputs) -> Float32[np.ndarray, " statistics"]:
        """The scene statistics of what was drawn last with `inputs`: waits for the GPU."""
        if self._statistics is None:
            self._statistics = SceneStatisticsPass(self.resources, self.setup.maps)
        self._statistics.draw(inputs)
        return self._statistics.read()

    def camera(self, view: View) -> CameraUniforms:
        """The view's camera as the shaders know it."""
        return camera_uniforms(view.camera, self.setup.size, self.scene.bounds())

    def _make_targets(self) -> None:
        resources, setup = self.resources, self.setup
        context, size = resources.context, setup.size
        self.gbuffer = create_gbuffer(context, size, glows=self.scene.glows)
        self.rsm = create_reflective_shadow_map(context, setup.rsm_resolution, setup.face_count)
        for name in ("depth", "normal", "albedo"):
            resources[f"gbuffer_{name}"] = getattr(self.gbuffer, name)
        if self.gbuffer.emission is not None:
            resources["gbuffer_emission"] = self.gbuffer.emission
        for name in ("depth", "normal", "reflectance"):
            resources[f"rsm_{name}"] = getattr(self.rsm, name)
        names = ["direct", "vpl", "near_field", "shared"]
        names += ["punctual"] * (setup.pools.glowing > 0) + ["lamp"] * (setup.sky_count > 0)
        for name in names:
            resources[f"{name}_irradiance"] = create_irradiance_target(context, size)
        resources.alias("indirect_irradiance", "vpl_irradiance")
        resources["radiance"] = create_irradiance_target(context, size)
        resources["display"] = create_display_target(context, size)
        interleaved = setup.interleave > 1
        resources["pixel_list"] = create_pixel_list(
            context, size if interleaved or setup.sky_count else (1, 1)
        )
        if interleaved:
            resources["shared_direction"] = create_direction_target(context, size)
        resources["artist_parameters"] = context.buffer(reserve=BLOCK_BYTES)
        self._parameters: ArtistParameters | None = None
        resources["lights"] = context.buffer(reserve=LIGHT_DTYPE.itemsize)
        resources["rsm_faces"] = context.buffer(reserve=max(1, setup.face_count) * FACE_DTYPE.itemsize)

    def _interleaved_passes(self) -> list[FramePass]:
        if self.setup.interleave == 1:
            return []
        shadowed = self.setup.maps.size > 0
        return [
            InterleavedFilterPass(self.resources, self.setup.interleave, shadowed=shadowed),
            GatherListedPixelsPass(self.resources, self.setup.maps, self.setup.pools),
        ]

    def _placing_passes(
        self, options: RuntimeOptions, hierarchy: RayHierarchy | None, glowing: GlowingTriangles | None
    ) -> list[FramePass]:
        """The passes that place the VPLs of each pool."""
        resources, setup, pools = self.resources, self.setup, self.setup.pools
        has_lamps = setup.face_count > 0
        emitting = None
        if glowing is not None:
            emitting = DiscPool.glowing(pools.glowing)
        starts = None
        if pools.later and has_lamps:
            starts = walk_table(options.walks if emitting is None else options.walks // 2)[:, :2]
        light: list[FramePass] = [
            VirtualPointLightsPass(
                resources,
                self.rsm,
                pools.first,
                options.point_table,
                options.rsm_filtering,
                setup.importance_cells,
                starts,
            )
        ]
        discs = [DiscPool.first(pools.first)]
        if glowing is not None and emitting is not None:
            light.append(GlowingSurfacesPass(resources, glowing, emitting))
        if pools.later:
            assert hierarchy is not None, "light walks along rays"
            walks = LightWalksPass(
                resources,
                hierarchy,
                setup.bounces,
                emitting,
                pools.later,
                options.walks,
                has_lamps=has_lamps,
            )
            light.append(walks)
            discs.append(DiscPool.later(pools.later, walks.sample_count))
        if emitting is not None:
            discs.append(emitting)
        clustered = [ClusteredDiscsPass(resources, pool) for pool in discs]
        return [*light, *clustered, JoinedVplsPass(resources, discs)]

    def _run(self, passes: list[FramePass], inputs: FrameInputs, clock: PassClock | None) -> None:
        indirect = "near_field_irradiance" if self._near_field_wanted(inputs) else "vpl_irradiance"
        self.resources.alias("indirect_irradiance", indirect)
        for each in passes:
            if each.wanted(inputs):
                with _timed(clock, each.name):
                    each.draw(inputs)

    def _write_lights(self, records: LightRecords) -> None:
        size = max(1, len(records.lights)) * LIGHT_DTYPE.itemsize
        if self.resources.buffer("lights").size < size:
            self.resources["lights"] = self.resources.context.buffer(reserve=size)
        if len(records.lights):
            self.resources.write("lights", np.ascontiguousarray(records.lights).tobytes())
        if len(records.faces):
            self.resources.write("rsm_faces", np.ascontiguousarray(records.faces).tobytes())

    def _write_parameters(self, parameters: ArtistParameters) -> None:
        # A prior writes into the same buffer, and only what it sets anew in every frame.
        if parameters != self._parameters:
            self.resources.write("artist_parameters", parameter_bytes(parameters))
            self._parameters = parameters


def frame_light_records(
    scene: SceneBuffers,
    view: View,
    rsm_resolution: int,
    nested_faces: int,
    sky: tuple[Light, ...] = (),
    *,
    snapped: bool,
) -> LightRecords:
    """The view's lights as records for the scene as it stands.

    Args:
        scene: gives the bounds.
        view: camera and lights.
        rsm_resolution: texels along the side of a face.
        nested_faces: of each directional light of the view.
        sky: lights that stand for the scene's sky.
        snapped: whether a directional light's faces keep their grid in the world while things move.
    """
    length = float(np.linalg.norm(scene.rest_bounds[1] - scene.rest_bounds[0])) if snapped else None
    x, y, z = view.camera.position_world.tolist()
    return light_records(
        view.lights, scene.bounds(), SunGrid(rsm_resolution, (x, y, z), nested_faces, length), sky
    )


def _timed(clock: PassClock | None, name: str) -> AbstractContextManager[None]:
    return nullcontext() if clock is None else clock.timed(name)
