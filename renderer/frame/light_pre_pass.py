"""Light pre-pass (Engel 2008): dynamic lights summed at every pixel, by volumes or in tiles.

Which of the two is faster hangs on the machine, the image size and the lights; it is measured, not assumed.
"""

import time

import moderngl

from vpltune.renderer.frame.passes.light_volumes import LightVolumesPass
from vpltune.renderer.frame.passes.tiled_lights import TiledLightsPass
from vpltune.renderer.frame.runtime_options import LightPath
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.dynamic_light_buffer import DynamicLightBuffer
from vpltune.renderer.gpu.render_targets import GBuffer, LightAccumulation
from vpltune.renderer.scene.dynamic_lights import DynamicLights

MEASURED_DRAWS = 2
"""Timed draws of each way, after one untimed; the faster counts, since disturbances only add."""

_PASSES = {"volumes": LightVolumesPass, "tiles": TiledLightsPass}

LightPass = LightVolumesPass | TiledLightsPass


class LightPrePass:
    """G-buffer, lights → light accumulation, the way that `light_path` asks for."""

    def __init__(self, context: moderngl.Context, gbuffer: GBuffer, light_path: LightPath):
        self._context = context
        self._gbuffer = gbuffer
        self._light_path = light_path
        self._buffer = DynamicLightBuffer(context)
        self._passes: dict[str, LightPass] = {}
        self._chosen: dict[int, str] = {}
        self.milliseconds: dict[int, dict[str, float]] = {}
        """What was measured, by the power of two that holds the number of lights."""

    def draw(self, camera: CameraUniforms, lights: DynamicLights | None) -> LightAccumulation | None:
        """Upload and sum the lights; None where there are none."""
        if lights is None or not len(lights):
            return None
        self._buffer.upload(lights)
        light_pass = self.light_pass(self.path(camera, lights))
        light_pass.draw(camera, lights)
        return LightAccumulation(light_pass.light_accumulation, lights.accumulation_unit)

    def path(self, camera: CameraUniforms, lights: DynamicLights) -> str:
        """ "volumes" or "tiles". With "auto", the first frame with about this many lights measures both.

        A choice once made stands for the numbers of lights up to the same power of two, so that frames
        repeat bitwise.
        """
        if self._light_path != "auto":
            return self._light_path
        key = (len(lights) - 1).bit_length()
        if key not in self._chosen:
            measured = {name: self._measured(name, camera, lights) for name in _PASSES}
            self.milliseconds[key] = measured
            self._chosen[key] = min(measured, key=lambda name: measured[name])
        return self._chosen[key]

    def light_pass(self, path: str) -> LightPass:
        """The pass, made when it is first asked for."""
        if path not in self._passes:
            self._passes[path] = _PASSES[path](self._context, self._gbuffer)
        return self._passes[path]

    def _measured(self, path: str, camera: CameraUniforms, lights: DynamicLights) -> float:
        """Milliseconds by the wall clock: timer queries tell too little on software renderers."""
        light_pass = self.light_pass(path)
        light_pass.draw(camera, lights)
        self._context.finish()
        durations = []
        for _ in range(MEASURED_DRAWS):
            start = time.perf_counter()
            light_pass.draw(camera, lights)
            self._context.finish()
            durations.append(1e3 * (time.perf_counter() - start))
        return min(durations)
