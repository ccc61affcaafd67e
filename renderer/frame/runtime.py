"""The runtime: a scene and a tuned config in, images out."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, get_args

import moderngl
import numpy as np
from jaxtyping import Float32

from vpltune.renderer.config.artist_parameters import ArtistParameters, placement
from vpltune.renderer.config.tuned_config import TunedConfig, Visibility, read_config
from vpltune.renderer.frame.capture import CapturedFrame, capture_frame, read_image
from vpltune.renderer.frame.frame import Frame, frame_light_records
from vpltune.renderer.frame.frame_timing import FrameTiming, frame_milliseconds
from vpltune.renderer.frame.passes.auto_parameters import AutoParametersPass
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.gpu.gpu_context import check_errors, create_context, free_dropped
from vpltune.renderer.gpu.ray_hierarchy import RayHierarchy
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.scene.animation import Pose
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.light_faces import face_count
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View

Layer = Literal["final", "direct", "indirect", "irradiance", "albedo", "normal", "depth"]
LAYERS: tuple[Layer, ...] = get_args(Layer)

RSM_RESOLUTION = 1024
"""Texels along the side of an RSM face: shadows come from the same map, which sets the number."""
RSM_RESOLUTION_OF_MANY = 512
"""The same where there are more than `FEW_FACES`: a point light has six."""
FEW_FACES = 2

DEFAULT_OPTIONS = RuntimeOptions()

_SHARES = {"direct": (1.0, 0.0), "indirect": (0.0, 1.0)}


def _on_own_context(method: Callable[..., Any]) -> Callable[..., Any]:
    """Make the runtime's context current before a call: another runtime may have taken its place.

    It stays current. moderngl's `with context` would leave none current behind it, not the one before.
    """

    @functools.wraps(method)
    def on_own_context(self: "Runtime", *arguments: object, **keywords: object) -> Any:
        self._context.__enter__()
        return method(self, *arguments, **keywords)

    return on_own_context


class Runtime:
    """Draws a scene with direct light and one bounce of VPL light, on the GPU alone.

    Example:
        >>> runtime = Runtime(read_scene(path), "default")
        >>> image = runtime.render(view)  # [height, width, 3], uint8, sRGB

    Raises:
        InputError: the config cannot be read.
        MachineError: no OpenGL 4.5.
    """

    def __init__(
        self,
        scene: Scene,
        config: TunedConfig | str | Path = "default",
        options: RuntimeOptions = DEFAULT_OPTIONS,
        *,
        rsm_resolution: int | None = None,
        context: moderngl.Context | None = None,
    ):
        loaded = config if isinstance(config, TunedConfig) else read_config(config)
        self.options = options
        self._parameters = loaded.parameters
        self.visibility: Visibility = loaded.visibility
        self._context = create_context() if context is None else context
        self.opengl_renderer: str = self._context.info["GL_RENDERER"]
        self._rsm_resolution = rsm_resolution
        self._context.__enter__()
        self.scene_buffers = SceneBuffers(self._context, scene)
        # Not the frame's: it remembers where the parameters stand when size or lights change.
        self._auto_parameters: AutoParametersPass | None = None
        if loaded.auto is not None:
            self._auto_parameters = AutoParametersPass(self._context, loaded.auto, options.adaptation_frames)
        self._hierarchy: RayHierarchy | None = None
        self._scene = scene
        self._frames: dict[tuple[tuple[int, int], int, int, bool, bool], Frame] = {}

    @property
    def parameters(self) -> ArtistParameters:
        """The config's. Setting them takes the place of its prior, if it has one."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: ArtistParameters) -> None:
        self._parameters, self._auto_parameters = parameters, None

    @_on_own_context
    def render(
        self,
        view: View,
        layer: Layer = "final",
        exposure: float | None = None,
        lights: DynamicLights | None = None,
    ) -> np.ndarray:
        """Draw one layer of a view, row 0 at the top; `lights` shine beside the view's own.

        `final` is [height, width, 3] uint8, sRGB, after exposure (None: measured) and tone curve. The
        others are linear float32: `direct` and `indirect` radiance and their sum before the tone curve
        (see `render_radiance`), `irradiance` the indirect irradiance [W/m²], `albedo` in [0, 1],
        `normal` in world space, `depth` [height, width] along the view axis in world units (0: nothing).

        Raises:
            MachineError: the GPU ran out of memory or reported an error.
        """
        if layer in ("irradiance", "albedo", "normal", "depth"):
            captured = self.capture(view, lights=lights)
            return {
                "irradiance": captured.indirect_irradiance,
                "albedo": captured.albedo,
                "normal": captured.normal_world * captured.valid[..., None],
                "depth": captured.depth,
            }[layer]
        frame = self._draw(view, lights=lights)
        frame.resolve(_SHARES.get(layer, (1.0, 1.0)), exposure)
        image = read_image(frame.display if layer == "final" else frame.radiance)[..., :3]
        check_errors(self._context, f"layer {layer} of view {view.name}")
        return np.ascontiguousarray(image)

    @_on_own_context
    def draw(
        self, view: View, exposure: float | None = None, lights: DynamicLights | None = None
    ) -> moderngl.Texture:
        """Draw a view up to the 8-bit display image, which stays on the GPU: nothing is read back.

        Row 0 is at the bottom; the texture is the frame's own and holds until the next draw.
        """
        frame = self._draw(view, lights=lights)
        frame.resolve((1.0, 1.0), exposure)
        return frame.display

    @_on_own_context
    def render_radiance(self, view: View, lights: DynamicLights | None = None) -> np.ndarray:
        """Direct plus indirect radiance, [height, width, 3] float32, linear, without a tone curve."""
        frame = self._draw(view, lights=lights)
        frame.resolve((1.0, 1.0), 1.0)
        return np.ascontiguousarray(read_image(frame.radiance)[..., :3])

    @_on_own_context
    def display(self, radiance: np.ndarray, exposure: float | None = None) -> np.ndarray:
        """Any radiance image, [height, width, 3 or 4], through this runtime's exposure and tone curve.

        Returns [height, width, 3] uint8, sRGB. References are shown the same way as our own images.
        """
        frame = self._frame((radiance.shape[1], radiance.shape[0]), 1)
        pixels = np.ones((*radiance.shape[:2], 4), np.float32)
        pixels[..., : radiance.shape[2]] = radiance
        frame.radiance.write(np.ascontiguousarray(pixels[::-1]).tobytes())
        frame.tone_map(exposure)
        return np.ascontiguousarray(read_image(frame.display)[..., :3])

    @_on_own_context
    def pass_milliseconds(
        self, view: View, frames: int = 5, lights: DynamicLights | None = None
    ) -> dict[str, float]:
        """Milliseconds of each pass, the median of `frames` frames after one that is not timed."""
        frame = self._draw(view, lights=lights)
        with FrameTiming(self._context, frame) as timing:
            for _ in range(frames):
                self.draw(view, lights=lights)
                timing.end_frame()
        return timing.milliseconds()

    @property
    def context(self) -> moderngl.Context:
        """The OpenGL context, for other runtimes to share."""
        return self._context

    @_on_own_context
    def frame_milliseconds(self, view: View, frames: int = 5, lights: DynamicLights | None = None) -> float:
        """Milliseconds of a whole frame, the median of `frames` frames after one that is not timed."""
        self.draw(view, lights=lights)
        return frame_milliseconds(self._context, lambda: self.draw(view, lights=lights), frames)

    @_on_own_context
    def exposure(self) -> float:
        """What multiplied radiance in the last image for display: for the next ones of a sequence.

        Raises:
            ValueError: there was none yet.
        """
        return self._last_frame("exposure").read_exposure()

    @_on_own_context
    def drawn_parameters(self) -> ArtistParameters:
        """What the last image was drawn with, where a prior sets them: waits for the GPU.

        Raises:
            ValueError: there was none yet.
        """
        if self._auto_parameters is None:
            return self._parameters
        return self._last_frame("drawn_parameters").parameters.read()

    @_on_own_context
    def scene_statistics(self, view: View) -> Float32[np.ndarray, " statistics"]:
        """What `renderer.config.scene_statistics` names, of the view that was drawn last: waits for the GPU.

        Raises:
            ValueError: there was none yet.
        """
        return self._last_frame("scene_statistics").read_statistics(view)

    @_on_own_context
    def pose(self, pose: Pose) -> None:
        """Move the scene; takes effect with the next image."""
        self.scene_buffers.set_pose(pose.transforms, pose.joint_matrices)

    @_on_own_context
    def capture(
        self,
        view: View,
        table_rotation: tuple[float, float] = (0.0, 0.0),
        lights: DynamicLights | None = None,
    ) -> CapturedFrame:
        """Draw a view and read back the buffers that the gather reads and makes.

        `table_rotation` in [0, 1)² shifts the VPL point table on its torus: another, equally good
        placement of the VPLs.
        """
        return self._captured(self._draw(view, table_rotation, lights), view)

    @_on_own_context
    def captures(self, view: View, table_rotations: Sequence[tuple[float, float]]) -> list[CapturedFrame]:
        """As `capture`, once for each rotation: what does not depend on it is drawn once."""
        captured = []
        for index, rotation in enumerate(table_rotations):
            if index == 0:
                frame = self._draw(view, rotation)
            else:
                frame.draw_indirect_again(view, self._gathered_parameters(), rotation)
            captured.append(self._captured(frame, view))
        return captured

    @_on_own_context
    def capture_variants(
        self,
        view: View,
        parameters: Sequence[ArtistParameters],
        table_rotation: tuple[float, float] = (0.0, 0.0),
    ) -> tuple[CapturedFrame, list[Float32[np.ndarray, "height width 3"]]]:
        """Capture a view, and gather its indirect irradiance [W/m²] with each of `parameters`.

        The parameters must place VPLs alike: VPLs and their visibility maps are drawn once. The captured
        frame is that of the first parameters, without maps. The last parameters replace the runtime's own,
        and its prior.

        Raises:
            ValueError: there are no parameters, or they place VPLs differently.
        """
        if len({placement(each) for each in parameters}) != 1:
            raise ValueError(
                "capture_variants: parameters must be one or more with one placement of the VPLs"
            )
        self.parameters = parameters[0]
        frame = self._draw(view, table_rotation)
        captured = capture_frame(frame, view, maps=False)
        images = [captured.indirect_irradiance]
        for each in parameters[1:]:
            self.parameters = each
            frame.gather_again(view, self._gathered_parameters())
            images.append(np.ascontiguousarray(read_image(frame.indirect_irradiance)[..., :3]))
        check_errors(self._context, f"the irradiance of view {view.name}")
        return captured, images

    def _captured(self, frame: Frame, view: View) -> CapturedFrame:
        captured = capture_frame(frame, view)
        check_errors(self._context, f"the buffers of view {view.name}")
        return captured

    def _draw(
        self,
        view: View,
        table_rotation: tuple[float, float] = (0.0, 0.0),
        lights: DynamicLights | None = None,
    ) -> Frame:
        records = frame_light_records(self.scene_buffers, view, self._snapped_cells(view))
        frame = self._frame(view.size, len(records.faces))
        frame.draw(view, records, self._gathered_parameters(), table_rotation, lights)
        return frame

    def _gathered_parameters(self) -> ArtistParameters:
        if self.visibility == "none":
            return replace(self.parameters, extinction_coefficient=0.0)
        return self.parameters

    def _frame(self, size: tuple[int, int], face_count: int) -> Frame:
        maps = self.visibility == "maps"
        auto = self._auto_parameters
        key = (size, face_count, self.parameters.vpl_count, maps, auto is not None)
        if key not in self._frames:
            # One frame's targets at a time: images of many sizes must not add up in GPU memory.
            self._frames.clear()
            free_dropped(self._context)
            resolution = self._face_resolution(face_count)
            if maps and self._hierarchy is None:
                self._hierarchy = RayHierarchy(self._context, self._scene, self.scene_buffers)
            self._frames[key] = Frame(
                self._context,
                self.scene_buffers,
                size,
                resolution,
                face_count,
                self.parameters.vpl_count,
                self.options,
                self._hierarchy if maps else None,
                auto,
            )
        return self._frames[key]

    def _last_frame(self, asked: str) -> Frame:
        if not self._frames:
            raise ValueError(f"{asked}: no image has been drawn yet")
        (frame,) = self._frames.values()
        return frame

    def _face_resolution(self, face_count: int) -> int:
        if self._rsm_resolution is not None:
            return self._rsm_resolution
        return RSM_RESOLUTION if face_count <= FEW_FACES else RSM_RESOLUTION_OF_MANY

    def _snapped_cells(self, view: View) -> int | None:
        if not self.options.rsm_snapping:
            return None
        return self._face_resolution(face_count(view.lights))
