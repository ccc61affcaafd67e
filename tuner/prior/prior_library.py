"""What a prior is trained on: scenes with references, each captured at several VPL counts, as loss tables.

A scene's part is made once and kept in the user's cache folder, under all that it depends on.
"""

import hashlib
import io
import json
from dataclasses import asdict, dataclass, fields, replace

import moderngl
import numpy as np
from jaxtyping import Bool, Float32, Int32

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.renderer.frame.runtime import DEFAULT_OPTIONS, Runtime
from vpltune.renderer.frame.visibility_map_layout import VisibilityMapLayout
from vpltune.renderer.scene.placement import views_for_scene
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View, views_to_json
from vpltune.tuner.prior.loss_table import (
    BIAS_PLACES,
    FOOTPRINT_PLACES,
    RECEIVERS,
    SOFTNESS_PLACES,
    LossTable,
    loss_table,
)
from vpltune.tuner.reference import ReferenceView, reference_views
from vpltune.tuner.reference.cache import cache_folder
from vpltune.tuner.reference.content_key import scene_digest
from vpltune.tuner.surrogate.captured_view import CapturedView

VIEW_SIZE = (64, 48)
FITTED, HELD_OUT = 2, 2
"""Views of each scene, each with a camera and a light position of its own."""
NOISE_TARGET, MAX_SAMPLES = 3e-3, 1024
RSM_RESOLUTION = 512
CONFIG = TunedConfig(visibility="maps", quality=Quality(rsm_resolution=RSM_RESOLUTION))
"""What scenes are captured with, at several VPL counts."""

_ROTATIONS = ((0.0, 0.0), (0.3, 0.7), (0.6, 0.1), (0.9, 0.4))
ROTATIONS = {16: _ROTATIONS, 64: _ROTATIONS[:3], 256: _ROTATIONS[:2]}
"""VPL counts, and the rotations of the point table that each is captured with: few VPLs are noisy, and one
placement's noise is not to be learnt."""

CAPTURE_VERSION = 3
"""Raise whenever the same scene gives other statistics or another loss: old entries are then passed over.
What the runtime's options, the quality and the maps' layout say is in the key by itself."""


_TABLES = ("table", "relmse_table")
_TABLE_PARTS = tuple(field.name for field in fields(LossTable))


@dataclass(frozen=True, eq=False)
class PriorScene:
    """One scene's captures: a row for each view, VPL count and rotation."""

    name: str
    statistics: Float32[np.ndarray, "rows statistics"]
    table: LossTable
    """Of the loss that fits have."""
    relmse_table: LossTable
    """Of relMSE alone, which images are judged by."""
    vpl_count: Int32[np.ndarray, " rows"]
    fitted: Bool[np.ndarray, " rows"]
    """Whether the row's view is one that a fit may see."""


def prior_scene(scene: Scene, context: moderngl.Context) -> PriorScene:
    """The scene's captures, from the cache or made; the scene has a camera and lights of its own.

    Raises:
        MachineError: the GPU ran out of memory.
    """
    views = prior_views(scene)
    key = _key(scene, views)
    path = cache_folder() / "prior" / f"{key}.npz"
    if path.is_file():
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as arrays:
            found = {name: arrays[name] for name in arrays.files}
        tables = {
            name: LossTable(*(found.pop(f"{name}_{part}") for part in _TABLE_PARTS)) for name in _TABLES
        }
        return PriorScene(name=scene.name, **tables, **found)
    made = _captured(context, scene, views, prior_references(scene, views))
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        statistics=made.statistics,
        vpl_count=made.vpl_count,
        fitted=made.fitted,
        **{f"{name}_{part}": getattr(getattr(made, name), part) for name in _TABLES for part in _TABLE_PARTS},
    )
    with written_whole(path) as temporary:
        temporary.write_bytes(buffer.getvalue())
    return made


def prior_views(scene: Scene) -> tuple[View, ...]:
    """The views that a scene is learnt from, the fitted ones first."""
    return views_for_scene(
        scene, scene.cameras[0], scene.lights, fitted=FITTED, held_out=HELD_OUT, size=VIEW_SIZE, seed=0
    )


def prior_references(scene: Scene, views: tuple[View, ...]) -> tuple[ReferenceView, ...]:
    """Their references, kept in the cache like any other."""
    return reference_views(scene, views, noise_target=NOISE_TARGET, max_samples=MAX_SAMPLES)


def _captured(
    context: moderngl.Context, scene: Scene, views: tuple[View, ...], references: tuple[ReferenceView, ...]
) -> PriorScene:
    statistics, tables, relmse_tables, counts, fitted = [], [], [], [], []
    runtime = Runtime(scene, context=context)
    for vpl_count, rotations in ROTATIONS.items():
        parameters = replace(ArtistParameters(), vpl_count=vpl_count)
        config = replace(CONFIG, parameters=parameters)
        for view, reference in zip(views, references, strict=True):
            for rotation in rotations:
                drawn = runtime.draw(view, config, table_rotation=rotation)
                captured = CapturedView(view, reference, drawn.capture())
                statistics.append(drawn.read_statistics())
                tables.append(loss_table(captured, parameters, seed=0))
                relmse_tables.append(loss_table(captured, parameters, seed=0, robust=False))
                counts.append(vpl_count)
                fitted.append(view.split == "fitted")
    stacked = (
        LossTable(*(np.stack([getattr(table, part) for table in of_rows]) for part in _TABLE_PARTS))
        for of_rows in (tables, relmse_tables)
    )
    return PriorScene(
        scene.name, np.stack(statistics), *stacked, np.array(counts, np.int32), np.array(fitted)
    )


def _key(scene: Scene, views: tuple[View, ...]) -> str:
    axes = [parameter_spec(name) for name in AUTO_PARAMETERS]
    content = {
        "scene": scene_digest(scene),
        "views": views_to_json(scene.name, views),
        "captures": [CAPTURE_VERSION, list(ROTATIONS.items()), NOISE_TARGET, MAX_SAMPLES, RSM_RESOLUTION],
        "statistics": STATISTIC_NAMES,
        "parameters": ArtistParameters().as_dict(),
        "runtime": [
            asdict(DEFAULT_OPTIONS),
            CONFIG.quality.as_dict(),
            VisibilityMapLayout.of(CONFIG).defines,
        ],
        "axes": [[spec.low, spec.high, spec.scale] for spec in axes],
        "nodes": [FOOTPRINT_PLACES, BIAS_PLACES, SOFTNESS_PLACES, RECEIVERS],
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
