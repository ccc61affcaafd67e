"""Frame time on this machine, pass by pass: measured once, then cached.

A pass takes a fixed time plus a time for each VPL. It is known which settings a pass depends on: the RSM
resolution changes the passes that read the RSM; interleaving and map size change the gather. So each setting
is timed alone, at two VPL counts, and the time of any combination is composed from these.
"""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.cache_folder import cache_folder
from vpltune.renderer.frame.rsm_resolution import rsm_resolution
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.shader_library import shaders_digest
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View
from vpltune.tuner.reference.content_key import scene_digest

COUNTS = (32, 256)
"""VPL counts at which each setting is timed. A choice."""
FRAMES = 5
"""Frames timed at each VPL count, of which the median is taken. A choice."""
INTERLEAVES = (1, 2, 4)
"""Values of `Quality.interleave` to choose from. A choice; `default_choice` has the first one."""
MAP_SIZES = (8, 16, 32)
"""Values of `Quality.map_size` to choose from. A choice."""
RSM_DIVISORS = (1, 2, 4)
"""The runtime's own RSM resolution over these gives the ones to choose from. A choice."""

_RSM_PASSES = frozenset(
    {"reflective_shadow_map", "vpl_importance", "virtual_point_lights", "clustered_discs"}
)
_GATHER_PASSES = frozenset({"vpl_gather", "interleaved_filter"})
_FORMAT = 4
"""Version of the cached files; it is part of their keys."""


@dataclass(frozen=True)
class PassCost:
    """Time of a pass with N VPLs: `fixed` + `per_vpl` · N, in milliseconds."""

    fixed: float
    per_vpl: float


Costs = dict[str, PassCost]
"""Cost of each pass, by name."""


@dataclass(frozen=True)
class CostModel:
    """Costs of the passes by the value of one setting, while the other settings are those of
    `default_choice`."""

    interleave: dict[int, Costs]
    map_size: dict[int, Costs]
    """Empty if VPLs have no visibility maps."""
    rsm_resolution: dict[int, Costs]

    def costs(self, choice: Quality) -> Costs:
        """Costs of all passes of a frame with these settings; `choice.rsm_resolution` must not be None."""
        gathered = self.interleave[block_side(choice)]
        mapped = self.map_size.get(choice.map_size, {})
        assert choice.rsm_resolution is not None, "a choice spells its RSM resolution out"
        shadowed = self.rsm_resolution[choice.rsm_resolution]
        combined = {}
        for name, cost in gathered.items():
            if name in _RSM_PASSES:
                cost = shadowed[name]
            elif name == "vpl_visibility_maps":
                cost = mapped[name]
            elif name in _GATHER_PASSES and mapped:
                cost = _scaled(cost, mapped["vpl_gather"], self._base(name="vpl_gather"))
            combined[name] = cost
        return combined

    def scaled(self, factor: float) -> "CostModel":
        """The model of a machine on which every pass takes `factor` times as long."""
        axes = {axis.name: getattr(self, axis.name) for axis in fields(self)}
        return CostModel(
            **{
                name: {value: _times(costs, factor) for value, costs in axis.items()}
                for name, axis in axes.items()
            }
        )

    def milliseconds(self, choice: Quality, count: int) -> float:
        """Time of a whole frame with `count` VPLs [ms]."""
        return sum(cost.fixed + cost.per_vpl * count for cost in self.costs(choice).values())

    def count_within(self, choice: Quality, milliseconds: float) -> float:
        """The number of VPLs that a frame of this time can have; below 1 if it can have none."""
        costs = self.costs(choice).values()
        return (milliseconds - sum(cost.fixed for cost in costs)) / self.per_vpl(choice)

    def per_vpl(self, choice: Quality) -> float:
        """Time that each further VPL adds to a frame [ms], at least 1e-6."""
        # Noise may make the slope vanish; 1e-6 ms is below what a timer resolves.
        return max(sum(cost.per_vpl for cost in self.costs(choice).values()), 1e-6)

    def _base(self, name: str) -> PassCost:
        return self.interleave[INTERLEAVES[0]][name]


def measured_cost_model(
    scene: Scene,
    views: Sequence[View],
    config: TunedConfig,
    runtime: Runtime,
    progress: Callable[[float], None] | None = None,
) -> CostModel:
    """The cost model of the slowest of `views`, from the cache or measured now.

    Args:
        scene: identifies the cached model.
        views: views at the size that is timed.
        config: visibility, light, and whether importance and the near field are drawn; its VPL count is
            ignored.
        runtime: draws `scene`.
        progress: called with the share of the measurements done, in [0, 1].

    Raises:
        MachineError: the GPU ran out of memory or reported an error.
    """
    key = costs_key(runtime.opengl_renderer, scene, views, config)
    path = cache_folder() / "costs" / f"{key}.json"
    kept = _read(path)
    if kept is not None:
        return kept
    base = default_choice(views[0])
    axes: dict[str, dict[int, Costs]] = {}
    values = {
        "interleave": INTERLEAVES,
        "map_size": MAP_SIZES if config.visibility == "maps" else (),
        "rsm_resolution": rsm_resolutions(views[0]),
    }
    total = sum(len(axis) for axis in values.values())
    done, measured = 0, {}
    for name, axis in values.items():
        axes[name] = {}
        for value in axis:
            choice = replace(base, **{name: value})
            if choice not in measured:
                measured[choice] = _measure(runtime, views, replace(config, quality=choice))
            axes[name][value] = measured[choice]
            done += 1
            if progress is not None:
                progress(done / total)
    model = CostModel(**axes)
    _write(path, model)
    return model


def costs_key(renderer: str, scene: Scene, views: Sequence[View], config: TunedConfig) -> str:
    """Hash of everything that the cost model depends on, the name of the OpenGL renderer included."""
    parts = [_FORMAT, renderer, shaders_digest(), scene_digest(scene), config.visibility]
    parts += [config.parameters.density_importance > 0.0, config.parameters.screen_space_strength > 0.0]
    parts += [config.parameters.lloyd_iterations, config.light.as_dict()]
    for view in views:
        parts += [view.size, view.camera.to_world.tolist(), view.camera.yfov]
        parts += [
            (light.kind, light.position_world.tolist(), light.direction_world.tolist(), light.outer_cone)
            for light in view.lights
        ]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def default_choice(view: View) -> Quality:
    """The default quality with a full gather, and the RSM resolution that the runtime picks for this view."""
    return Quality(interleave=INTERLEAVES[0], rsm_resolution=rsm_resolution(view.lights))


def block_side(choice: Quality) -> int:
    """Side of the pixel blocks that share the VPLs, which a choice to be timed never leaves to the frame."""
    assert choice.interleave != "auto", "a choice spells its interleaving out"
    return choice.interleave


def rsm_resolutions(view: View) -> tuple[int, ...]:
    """RSM resolutions to choose from, in texels; the first is the one that the runtime picks."""
    return tuple(rsm_resolution(view.lights) // divisor for divisor in RSM_DIVISORS)


def _times(costs: Costs, factor: float) -> Costs:
    return {name: PassCost(factor * cost.fixed, factor * cost.per_vpl) for name, cost in costs.items()}


def _scaled(cost: PassCost, other: PassCost, base: PassCost) -> PassCost:
    ratio = other.per_vpl / base.per_vpl if base.per_vpl > 0.0 else 1.0
    return PassCost(cost.fixed, cost.per_vpl * ratio)


def _measure(runtime: Runtime, views: Sequence[View], config: TunedConfig) -> Costs:
    """Time the slowest view at both VPL counts, and put a line through the two times of each pass."""
    at_count = []
    for count in COUNTS:
        counted = config.with_parameters(replace(config.parameters, vpl_count=count))
        by_view = [runtime.pass_milliseconds(view, counted, FRAMES) for view in views]
        at_count.append(max(by_view, key=lambda passes: sum(passes.values())))
    low, high = at_count
    costs = {}
    for name in high:
        slope = max(0.0, (high[name] - low.get(name, 0.0)) / (COUNTS[1] - COUNTS[0]))
        # Noise may make a pass slower with fewer VPLs; then its whole time counts as fixed.
        costs[name] = PassCost(max(0.0, high[name] - slope * COUNTS[1]), slope)
    return costs


def _write(path: Path, model: CostModel) -> None:
    try:
        write_text_whole(path, json.dumps(asdict(model), indent=1) + "\n")
    except (InputError, MachineError):
        return  # the cache cannot be written to: the model is measured again next time


def _read(path: Path) -> CostModel | None:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        return CostModel(
            **{
                name: {
                    int(value): {key: PassCost(**cost) for key, cost in costs.items()}
                    for value, costs in axis.items()
                }
                for name, axis in document.items()
            }
        )
    except (OSError, ValueError, TypeError, AttributeError):
        return None
