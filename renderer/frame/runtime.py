"""The runtime: draws a scene, one view and one config at a time."""

from collections import OrderedDict
from collections.abc import Sequence
from typing import Literal, get_args

import moderngl
import numpy as np
from jaxtyping import Float32

from vpltune.renderer.config.artist_parameters import placement
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.capture import CapturedFrame, read_image
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.drawn_frame import DrawnFrame, on_own_context
from vpltune.renderer.frame.frame import Frame, FrameSetup, frame_light_records
from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.frame.frame_timing import PassClock, frame_milliseconds
from vpltune.renderer.frame.runtime_options import DEFAULT_OPTIONS, RuntimeOptions
from vpltune.renderer.frame.visibility_map_layout import NO_MAPS
from vpltune.renderer.frame.vpl_pools import VplPools
from vpltune.renderer.gpu.glowing_triangles import GlowingTriangles
from vpltune.renderer.gpu.gpu_context import check_errors, create_context, free_dropped
from vpltune.renderer.gpu.ray_hierarchy import RayHierarchy
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.scene.animation import Pose
from vpltune.renderer.scene.dynamic_lights import DynamicLights, scaled_records
from vpltune.renderer.scene.scene import Scene, scaled
from vpltune.renderer.scene.sky_lights import SkyLights, sky_lights
from vpltune.renderer.scene.sun_faces import nested_face_count
from vpltune.renderer.scene.views import View, scaled_view
from vpltune.renderer.scene.working_scale import working_scale

Layer = Literal["final", "direct", "indirect", "irradiance", "albedo", "normal", "depth"]
LAYERS: tuple[Layer, ...] = get_args(Layer)

KEPT_FRAMES = 2
"""Frames whose targets stay on the GPU: two, for a comparison of two configs; more would add up."""

_SHARES = {"direct": (1.0, 0.0), "indirect": (0.0, 1.0)}


class Runtime:
    """Draws a scene with direct light, and light reflected once or more from VPLs, on the GPU alone.

    Drawing is a function of view, config and state: two calls with the same arguments give the same image,
    whatever was drawn between them. Only `pose` changes the scene.

    Example:
        >>> runtime = Runtime(read_scene(path))
        >>> image = runtime.render(view, read_config("tuned.json"))  # [height, width, 3], uint8, sRGB

    Raises:
        MachineError: no OpenGL 4.5.
    """

    def __init__(
        self,
        scene: Scene,
        options: RuntimeOptions = DEFAULT_OPTIONS,
        *,
        context: moderngl.Context | None = None,
    ):
        self.options = options
        self._context = create_context() if context is None else context
        self.opengl_renderer: str = self._context.info["GL_RENDERER"]
        self._context.__enter__()
        self._scale = working_scale(scene)
        self._scene = scene = scaled(scene, self._scale) if self._scale != 1.0 else scene
        self.scene_buffers = SceneBuffers(self._context, scene)
        self._skies: dict[int, SkyLights] = {}
        self._glowing = GlowingTriangles(self._context, scene, self.scene_buffers)
        self._hierarchy: RayHierarchy | None = None
        self._nested_faces = nested_face_count(scene)
        self._frames: OrderedDict[FrameSetup, Frame] = OrderedDict()

    def __repr__(self) -> str:
        return f"Runtime({self._scene.name!r}, {self.opengl_renderer})"

    @property
    def context(self) -> moderngl.Context:
        """The OpenGL context, for other runtimes to share."""
        return self._context

    @on_own_context
    def pose(self, pose: Pose) -> None:
        """Move the scene; takes effect with the next image."""
        grow = np.diag([self._scale, self._scale, self._scale, 1.0])
        self.scene_buffers.set_pose(grow @ pose.transforms, grow @ pose.joint_matrices)

    @on_own_context
    def render(
        self,
        view: View,
        config: TunedConfig,
        state: ClipState | None = None,
        *,
        layer: Layer = "final",
        exposure: float | None = None,
        lights: DynamicLights | None = None,
    ) -> np.ndarray:
        """Draw one layer of a view, row 0 at the top.

        `final` is [height, width, 3] uint8, sRGB, after exposure and tone curve. The others are linear
        float32: `direct` and `indirect` radiance and their sum before the tone curve (see `render_radiance`),
        `irradiance` the indirect irradiance [W/m²], `albedo` in [0, 1], `normal` in world space, `depth`
        [height, width] along the view axis in world units (0 where nothing is seen).

        Args:
            view: camera, lights and size.
            config: parameters, quality and visibility.
            state: what a clip carries from frame to frame; None draws a still.
            exposure: what multiplies radiance before the tone curve; None measures it.
            lights: dynamic lights, beside the view's own.

        Raises:
            MachineError: the GPU ran out of memory or reported an error.
        """
        if layer in ("irradiance", "albedo", "normal", "depth"):
            captured = self.capture(view, config, state, lights=lights, maps=False)
            return {
                "irradiance": captured.indirect_irradiance,
                "albedo": captured.albedo,
                "normal": captured.normal_world * captured.valid[..., None],
                "depth": captured.depth,
            }[layer]
        drawn = self._draw(view, config, state, lights=lights)
        drawn.frame.resolve(_SHARES.get(layer, (1.0, 1.0)), exposure)
        return self._read(drawn, "display" if layer == "final" else "radiance", f"layer {layer}", view)

    @on_own_context
    def draw(
        self,
        view: View,
        config: TunedConfig,
        state: ClipState | None = None,
        *,
        exposure: float | None = None,
        table_rotation: tuple[float, float] = (0.0, 0.0),
        lights: DynamicLights | None = None,
    ) -> DrawnFrame:
        """Draw a view up to the 8-bit display image, which stays on the GPU: nothing is read back.

        `table_rotation` as in `capture`.
        """
        drawn = self._draw(view, config, state, table_rotation=table_rotation, lights=lights)
        drawn.frame.resolve((1.0, 1.0), exposure)
        return drawn

    @on_own_context
    def render_radiance(
        self,
        view: View,
        config: TunedConfig,
        state: ClipState | None = None,
        *,
        lights: DynamicLights | None = None,
    ) -> np.ndarray:
        """Direct plus indirect radiance, [height, width, 3] float32, linear, without a tone curve."""
        drawn = self._draw(view, config, state, lights=lights)
        drawn.frame.resolve((1.0, 1.0), 1.0)
        return self._read(drawn, "radiance", "the radiance", view)

    @on_own_context
    def display(self, radiance: np.ndarray, exposure: float | None = None) -> np.ndarray:
        """Any radiance image, [height, width, 3 or 4], through this runtime's exposure and tone curve.

        Returns [height, width, 3] uint8, sRGB. References are shown the same way as our own images.
        """
        frame = self._tone_mapped(radiance, exposure)
        return np.ascontiguousarray(read_image(frame.resources, "display")[..., :3])

    @on_own_context
    def measured_exposure(self, radiance: np.ndarray) -> float:
        """The exposure that `display` measures for a radiance image."""
        return self._tone_mapped(radiance, None).read_exposure()

    @on_own_context
    def capture(
        self,
        view: View,
        config: TunedConfig,
        state: ClipState | None = None,
        *,
        table_rotation: tuple[float, float] = (0.0, 0.0),
        lights: DynamicLights | None = None,
        maps: bool = True,
    ) -> CapturedFrame:
        """Draw a view and read back the buffers that the gather reads and makes.

        Args:
            table_rotation: shift of the VPL point table on its torus, in [0, 1)²: another, equally good
                placement of the VPLs.
            maps: whether to read the visibility maps, where there are any.
        """
        drawn = self._draw(view, config, state, table_rotation=table_rotation, lights=lights)
        return drawn.capture(maps=maps)

    @on_own_context
    def captures(
        self, view: View, config: TunedConfig, table_rotations: Sequence[tuple[float, float]]
    ) -> list[CapturedFrame]:
        """As `capture`, once for each rotation: what does not depend on it is drawn once."""
        if not table_rotations:
            return []
        drawn = self._draw(view, config, None, table_rotation=table_rotations[0])
        captured = [drawn.capture()]
        for rotation in table_rotations[1:]:
            inputs = self._inputs(view, config, None, table_rotation=rotation)
            drawn.frame.draw_indirect_again(inputs)
            captured.append(drawn.capture())
        return captured

    @on_own_context
    def capture_variants(
        self,
        view: View,
        configs: Sequence[TunedConfig],
        table_rotation: tuple[float, float] = (0.0, 0.0),
    ) -> tuple[CapturedFrame, list[Float32[np.ndarray, "height width 3"]]]:
        """Capture a view, and gather its indirect irradiance [W/m²] with each of `configs`.

        The configs must draw VPLs alike: VPLs and their visibility maps are drawn once. The captured frame is
        that of the first config, without maps.

        Raises:
            ValueError: there are no configs, they draw VPLs differently, or one has a prior.
        """
        drawn_as = {(placement(each.parameters), self._setup(view, each)) for each in configs}
        if len(drawn_as) != 1:
            raise ValueError("capture_variants: configs must be one or more with one placement of the VPLs")
        if any(each.auto is not None for each in configs):
            raise ValueError("capture_variants: configs must have no prior")
        drawn = self._draw(view, configs[0], None, table_rotation=table_rotation)
        captured = drawn.capture(maps=False)
        images = [captured.indirect_irradiance]
        for config in configs[1:]:
            inputs = self._inputs(view, config, None, table_rotation=table_rotation)
            drawn.frame.gather_again(inputs)
            images.append(self._read(drawn, "indirect_irradiance", "the irradiance", view))
        return captured, images

    @on_own_context
    def pass_milliseconds(
        self, view: View, config: TunedConfig, frames: int = 5, lights: DynamicLights | None = None
    ) -> dict[str, float]:
        """Milliseconds of each pass, the median of `frames` frames after one that is not timed."""
        drawn = self.draw(view, config, lights=lights)
        clock = PassClock(self._context)
        for _ in range(frames):
            drawn.frame.draw(drawn.inputs, clock)
            drawn.frame.resolve((1.0, 1.0), None, clock)
            clock.end_frame()
        return clock.milliseconds()

    @on_own_context
    def frame_milliseconds(
        self, view: View, config: TunedConfig, frames: int = 5, lights: DynamicLights | None = None
    ) -> float:
        """Milliseconds of a whole frame, the median of `frames` frames after one that is not timed."""
        self.draw(view, config, lights=lights)
        return frame_milliseconds(self._context, lambda: self.draw(view, config, lights=lights), frames)

    def _tone_mapped(self, radiance: np.ndarray, exposure: float | None) -> Frame:
        height, width = radiance.shape[:2]
        frame = self._frame(FrameSetup((width, height), 1, 1, 1, VplPools(1), 1, 1, 0, NO_MAPS, None, 0.0))
        pixels = np.ones((height, width, 4), np.float32)
        pixels[..., : radiance.shape[2]] = radiance
        frame.texture("radiance").write(np.ascontiguousarray(pixels[::-1]).tobytes())
        frame.tone_map(exposure)
        return frame

    def _draw(
        self,
        view: View,
        config: TunedConfig,
        state: ClipState | None,
        *,
        table_rotation: tuple[float, float] = (0.0, 0.0),
        lights: DynamicLights | None = None,
    ) -> DrawnFrame:
        frame = self._frame(self._setup(view, config))
        inputs = self._inputs(view, config, state, table_rotation=table_rotation, lights=lights)
        frame.draw(inputs)
        return DrawnFrame(frame, inputs, self._scaled(view), config, self._scale)

    def _scaled(self, view: View) -> View:
        return view if self._scale == 1.0 else scaled_view(view, self._scale)

    def _inputs(
        self,
        view: View,
        config: TunedConfig,
        state: ClipState | None,
        *,
        table_rotation: tuple[float, float] = (0.0, 0.0),
        lights: DynamicLights | None = None,
    ) -> FrameInputs:
        frame = self._frame(self._setup(view, config))
        view = self._scaled(view)
        if lights is not None and self._scale != 1.0:
            lights = DynamicLights(scaled_records(lights.records, self._scale))
        low, high = self.scene_buffers.bounds()
        return FrameInputs(
            camera=frame.camera(view),
            records=frame_light_records(
                self.scene_buffers,
                view,
                frame.setup.rsm_resolution,
                self._nested_faces,
                self._sky(frame.setup.sky_count).lights,
                snapped=self.options.rsm_snapping,
            ),
            parameters=config.parameters,
            scene_diagonal=float(np.linalg.norm(high - low)),
            table_rotation=table_rotation,
            dynamic_lights=lights,
            state=state,
        )

    def _read(self, drawn: DrawnFrame, name: str, what: str, view: View) -> np.ndarray:
        image = np.ascontiguousarray(read_image(drawn.frame.resources, name)[..., :3])
        check_errors(self._context, f"{what} of view {view.name}")
        return image

    def _frame(self, setup: FrameSetup) -> Frame:
        if setup in self._frames:
            self._frames.move_to_end(setup)
            return self._frames[setup]
        while len(self._frames) >= KEPT_FRAMES:
            self._frames.popitem(last=False)
        free_dropped(self._context)
        sky = self._sky(setup.sky_count)
        casts_rays = setup.maps.size > 0 or setup.pools.later > 0 or len(sky.ray_flux) > 0
        if casts_rays and self._hierarchy is None:
            self._hierarchy = RayHierarchy(self._context, self._scene, self.scene_buffers)
        hierarchy = self._hierarchy if casts_rays else None
        glowing = self._glowing if setup.pools.glowing else None
        frame = Frame(self.scene_buffers, setup, self.options, hierarchy, glowing, sky)
        self._frames[setup] = frame
        return frame

    def _setup(self, view: View, config: TunedConfig) -> FrameSetup:
        glows, sky = self._glowing.count > 0, len(self._sky(config.light.sky_lights).lights)
        return FrameSetup.of(
            view, config, self._nested_faces, glows=glows, sky_lights=sky, options=self.options
        )

    def _sky(self, count: int) -> SkyLights:
        environment = self._scene.environment
        if environment is None or count == 0:
            return SkyLights()
        if count not in self._skies:
            self._skies[count] = sky_lights(environment, count)
        return self._skies[count]
