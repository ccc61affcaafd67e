"""The training data of a prior: scenes with references, captured at several VPL counts, as loss tables.

The data of each scene is computed once and cached in the user's cache folder, keyed by a hash of its inputs.
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
from vpltune.renderer.files.cache_folder import cache_folder
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import DEFAULT_OPTIONS
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
from vpltune.tuner.reference.content_key import scene_digest
from vpltune.tuner.surrogate.captured_view import CapturedView

VIEW_SIZE = (64, 48)
"""Width and height of the views in pixels. A choice."""
FITTED, HELD_OUT = 2, 2
"""Number of views of each scene; each has its own camera and light position. A choice."""
NOISE_TARGET, MAX_SAMPLES = 3e-3, 1024
"""Limits of the references, see `reference_views`. A choice: coarser than the defaults there."""
RSM_RESOLUTION = 512
"""Texels along the side of a face of the reflective shadow map. A choice."""
CONFIG = TunedConfig(visibility="maps", quality=Quality(interleave=1, rsm_resolution=RSM_RESOLUTION))
"""What scenes are captured with, at several VPL counts: the defaults, and a full gather."""

# Offsets of the point table. A choice.
_ROTATIONS = ((0.0, 0.0), (0.3, 0.7), (0.6, 0.1))
ROTATIONS = {32: _ROTATIONS, 128: _ROTATIONS[:2], 512: _ROTATIONS[:1]}
"""VPL counts, and the rotations of the point table at each. A choice: few VPLs are noisy, and the prior must
not learn the noise of a single placement."""

CAPTURE_VERSION = 11
"""Increase it whenever a code change gives other statistics or losses for the same scene. Old cache entries
are then ignored. Runtime options, quality and the layout of the maps are in the key anyway."""


_TABLES = ("table", "relmse_table")  # fields of PriorScene that are loss tables
_TABLE_PARTS = tuple(field.name for field in fields(LossTable))


@dataclass(frozen=True, eq=False)
class PriorScene:
    """The captures of one scene, one row for each view, VPL count and rotation."""

    name: str
    statistics: Float32[np.ndarray, "rows statistics"]
    table: LossTable
    """Tables of the robust loss of a fit."""
    relmse_table: LossTable
    """Tables of relMSE."""
    vpl_count: Int32[np.ndarray, " rows"]
    fitted: Bool[np.ndarray, " rows"]
    """Whether the view is fitted; otherwise it is held out."""


def prior_scene(scene: Scene, context: moderngl.Context) -> PriorScene:
    """The captures of a scene, from the cache or computed.

    Args:
        scene: A scene with at least one camera and one light.
        context: The OpenGL context to render in.

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
    """The views of a scene for the training, fitted views first."""
    return views_for_scene(
        scene, scene.cameras[0], scene.lights, fitted=FITTED, held_out=HELD_OUT, size=VIEW_SIZE, seed=0
    )


def prior_references(scene: Scene, views: tuple[View, ...]) -> tuple[ReferenceView, ...]:
    """The references of these views, cached like any others."""
    return reference_views(
        scene, views, noise_target=NOISE_TARGET, max_samples=MAX_SAMPLES, bounces=CONFIG.light.most_bounces
    )


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
    return PriorScene(
        scene.name,
        np.stack(statistics),
        _stacked(tables),
        _stacked(relmse_tables),
        np.array(counts, np.int32),
        np.array(fitted),
    )


def _stacked(tables: list[LossTable]) -> LossTable:
    return LossTable(**{part: np.stack([getattr(table, part) for table in tables]) for part in _TABLE_PARTS})


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
            CONFIG.light.as_dict(),
            VisibilityMapLayout.of(CONFIG).defines,
        ],
        "axes": [[spec.low, spec.high, spec.scale] for spec in axes],
        "nodes": [FOOTPRINT_PLACES, BIAS_PLACES, SOFTNESS_PLACES, RECEIVERS],
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
