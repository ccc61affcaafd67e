"""Light pre-pass (Engel 2008): dynamic lights summed at every pixel, by volumes or in tiles.

Which of the two is faster hangs on the machine, the image size and the lights; it is measured, not assumed.
"""

import time

import moderngl

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.passes.light_volumes import LightVolumesPass
from vpltune.renderer.frame.passes.tiled_lights import TiledLightsPass
from vpltune.renderer.frame.runtime_options import LightPath
from vpltune.renderer.gpu.render_targets import create_light_accumulation_target
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.scene.dynamic_lights import DynamicLights

MEASURED_DRAWS = 2
"""Timed draws of each way, after one untimed; the faster counts, since disturbances only add."""

_PASSES = {"volumes": LightVolumesPass, "tiles": TiledLightsPass}

LightPass = LightVolumesPass | TiledLightsPass


class LightPrePass(FramePass):
    """G-buffer, dynamic lights → `light_accumulation`, the way that `light_path` asks for."""

    name = "light_pre_pass"

    def __init__(self, resources: Resources, light_path: LightPath):
        self._resources = resources
        self._light_path = light_path
        self._buffer: moderngl.Buffer | None = None
        self._passes: dict[str, LightPass] = {}
        self._chosen: dict[int, str] = {}
        self.milliseconds: dict[int, dict[str, float]] = {}
        """What was measured, by the power of two that holds the number of lights."""
        # Bound where there are no dynamic lights, and then not read.
        resources["light_accumulation"] = create_light_accumulation_target(resources.context, (1, 1))

    def wanted(self, inputs: FrameInputs) -> bool:
        """Where there are dynamic lights."""
        return inputs.accumulation_unit > 0.0

    def draw(self, inputs: FrameInputs) -> None:
        """Upload and sum the lights."""
        assert inputs.dynamic_lights is not None
        self._upload(inputs.dynamic_lights)
        light_pass = self.light_pass(self.path(inputs))
        light_pass.draw(inputs)
        self._resources.alias("light_accumulation", light_pass.accumulation)

    def path(self, inputs: FrameInputs) -> str:
        """ "volumes" or "tiles". With "auto", the first frame with about this many lights measures both.

        A choice once made stands for the numbers of lights up to the same power of two, so that frames
        repeat bitwise.
        """
        if self._light_path != "auto":
            return self._light_path
        assert inputs.dynamic_lights is not None
        key = (len(inputs.dynamic_lights) - 1).bit_length()
        if key not in self._chosen:
            measured = {name: self._measured(name, inputs) for name in _PASSES}
            self.milliseconds[key] = measured
            self._chosen[key] = min(measured, key=lambda name: measured[name])
        return self._chosen[key]

    def light_pass(self, path: str) -> LightPass:
        """The pass, made when it is first asked for."""
        if path not in self._passes:
            self._passes[path] = _PASSES[path](self._resources)
        return self._passes[path]

    def _upload(self, lights: DynamicLights) -> None:
        """One write a frame; a new buffer only where there are more lights than ever."""
        size = lights.numbers.nbytes
        if self._buffer is None or self._buffer.size < size:
            self._buffer = self._resources["dynamic_lights"] = self._resources.context.buffer(reserve=size)
        self._buffer.write(lights.numbers)

    def _measured(self, path: str, inputs: FrameInputs) -> float:
        """Milliseconds by the wall clock: timer queries tell too little on software renderers."""
        light_pass, context = self.light_pass(path), self._resources.context
        light_pass.draw(inputs)
        context.finish()
        durations = []
        for _ in range(MEASURED_DRAWS):
            start = time.perf_counter()
            light_pass.draw(inputs)
            context.finish()
            durations.append(1e3 * (time.perf_counter() - start))
        return min(durations)
