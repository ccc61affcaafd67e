"""Frame times by a formula: the machine's mood is not what is tested."""

import numpy as np
import pytest

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime


def pass_times(config: TunedConfig) -> dict[str, float]:
    """Frame times of a machine that draws 0.05 ms a VPL, less where pixels share them out."""
    count, interleave = config.parameters.vpl_count, config.quality.interleave
    resolution = config.quality.rsm_resolution or 1024
    passes = {
        "reflective_shadow_map": 4.0 * (resolution / 1024) ** 2,
        "virtual_point_lights": 6.0 * (resolution / 1024) ** 2 + 0.001 * count,
        "vpl_gather": 1.0 + 0.05 * count / interleave**2,
        "tone_mapping": 0.5,
    }
    if config.visibility == "maps":
        passes["vpl_visibility_maps"] = 0.002 * count * (config.quality.map_size / 24) ** 2
    if interleave > 1:
        passes["interleaved_filter"] = 2.0
    return passes


def steady_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames take 8 % longer than their passes, and none twice the same."""
    noise = np.random.default_rng(0)

    def passes(self, view, config, frames=5):
        return pass_times(config)

    def frame(self, view, config, frames=5, lights=None):
        return 1.08 * sum(pass_times(config).values()) * (1.0 + 0.01 * noise.standard_normal())

    monkeypatch.setattr(Runtime, "pass_milliseconds", passes)
    monkeypatch.setattr(Runtime, "frame_milliseconds", frame)
