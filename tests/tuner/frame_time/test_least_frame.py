"""A budget that no frame can meet is refused before references and fit."""

import pytest
from built_scenes import room_view

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.frame_time.least_frame import require_possible_budget

TIMES = {1: 40.0, 2: 15.0, 4: 10.0}


class Timed(Runtime):
    """A runtime whose frames take the times above, by interleaving."""

    def __init__(self):
        self.drawn = []

    def frame_milliseconds(self, view, config, frames=5, lights=None):
        self.drawn.append(config)
        return TIMES[config.quality.interleave]


def test_a_budget_below_the_fastest_frame_is_refused():
    with pytest.raises(InputError, match=r"--budget-ms: must be at least 10 .* frames of 64x48, got 7.9"):
        require_possible_budget(Timed(), room_view("spot", (64, 48)), TunedConfig(light=ONE_BOUNCE), 7.9, 4)


def test_a_close_call_is_left_to_the_fit():
    """And nothing slower is timed than what settles it."""
    runtime = Timed()
    require_possible_budget(runtime, room_view("spot", (64, 48)), TunedConfig(light=ONE_BOUNCE), 12.1, 4)
    assert [config.quality.interleave for config in runtime.drawn] == [1, 2]
    for config in runtime.drawn:
        assert config.parameters.vpl_count == 4 * config.quality.interleave**2
        assert config.quality.map_size == 8
        assert config.quality.rsm_resolution is not None
