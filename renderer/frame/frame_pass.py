"""What a pass is, and what one drawing of a frame is given."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.light_faces import LightRecords


@dataclass(frozen=True, eq=False)
class FrameInputs:
    """All that one drawing of a frame depends on, beside the scene and the frame's own size and quality."""

    camera: CameraUniforms
    records: LightRecords
    parameters: ArtistParameters
    scene_diagonal: float
    """World units."""
    table_rotation: tuple[float, float] = (0.0, 0.0)
    """Shift of the VPL point table on its torus, in [0, 1)²."""
    dynamic_lights: DynamicLights | None = None
    state: ClipState | None = None
    """What the clip carries from frame to frame; None for a still."""

    @property
    def light_count(self) -> int:
        """Lights that have an RSM."""
        return len(self.records.lights)

    @property
    def accumulation_unit(self) -> float:
        """Irradiance [W/m²] that the light accumulation stores as 1; 0 without dynamic lights."""
        lights = self.dynamic_lights
        return lights.accumulation_unit if lights is not None and len(lights) else 0.0


class FramePass(ABC):
    """One step of a frame. Its programs declare what they read and write (`renderer.gpu.gpu_program`)."""

    name: str
    """Also that of its time in `Runtime.pass_milliseconds`; steps of one technique may share it."""

    def wanted(self, inputs: FrameInputs) -> bool:
        """Whether this drawing needs the step."""
        return True

    @abstractmethod
    def draw(self, inputs: FrameInputs) -> None:
        """Draw the step."""
