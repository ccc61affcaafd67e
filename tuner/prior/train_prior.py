"""Train a prior for `--config auto`: from scenes to a config and its card."""

import importlib.metadata
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.auto_prior import AutoPrior
from vpltune.renderer.config.tuned_config import TunedConfig, write_config
from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import write_text_whole, written_together
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights, with_environment
from vpltune.renderer.scene.scene import Scene
from vpltune.tuner.batch.scene_files import library_scenes
from vpltune.tuner.evaluation.prepare_scene import Progress
from vpltune.tuner.prior.prior_card import prior_card
from vpltune.tuner.prior.prior_library import PriorScene, prior_scene
from vpltune.tuner.prior.prior_training import (
    FOLDS,
    LearntPrior,
    OwnFits,
    TrainingRows,
    own_fits,
    row_losses,
    train,
    training_rows,
)
from vpltune.tuner.prior.scene_generator import generated_name, generated_scene
from vpltune.tuner.surrogate.compiled_functions import keep_compiled_functions


def learn_prior(scenes: tuple[PriorScene, ...], progress: Progress) -> LearntPrior:
    """Fit each scene by itself, train a prior on all scenes, and cross-validate it in `FOLDS` groups.

    Leaving out groups is a harder test than leaving out single scenes, because fewer scenes remain for
    training.
    """
    progress("each scene's own fit", 0.0)
    fits = own_fits(scenes)
    rows = training_rows(scenes, fits)
    progress("training", 0.0)
    (prior,) = train(rows, np.zeros((1, len(scenes)), bool))
    progress("training with scenes left out", 0.0)
    fold = np.arange(len(scenes)) % FOLDS
    of_folds = train(rows, fold == np.arange(FOLDS)[:, None])
    unseen = tuple(of_folds[index] for index in fold)
    return LearntPrior(scenes, fits, prior, _losses(scenes, rows, fits, unseen))


def train_prior(
    library: Path | None, generated: int, seed: int, output: Path, command: str | None, progress: Progress
) -> dict[str, Any]:
    """Train a prior on generated scenes and those of a library; write the config and its card.

    The card is a Markdown file beside the config. Captures and references are cached, so an interrupted run
    continues where it stopped. A scene that cannot be read, or with an unlit view, is left out and named in
    the result.

    Args:
        library: Folder or list of scenes; None for generated scenes only.
        generated: Number of generated scenes.
        seed: Seed of the generated scenes.
        output: Path of the config.
        command: The command line, for the record.
        progress: Called with the stage and the share of it that is done.

    Returns:
        The document that `vpltune train-prior --json` prints.

    Raises:
        InputError: the library cannot be read, or fewer than `FOLDS` scenes are usable.
        MachineError: there is no OpenGL.
    """
    keep_compiled_functions()
    scenes, left_out = collected_scenes(scene_sources(library, generated, seed), progress)
    if len(scenes) < FOLDS:
        raise InputError(f"train-prior: needs at least {FOLDS} scenes, got {len(scenes)}")
    learnt = learn_prior(scenes, progress)
    provenance: dict[str, str | int | float] = {
        "vpltune": importlib.metadata.version("vpltune"),
        "scenes": len(scenes),
        "generated": generated,
        "seed": seed,
        **({} if command is None else {"command": command}),
    }
    config = TunedConfig(ArtistParameters(), provenance, "maps", learnt.prior)
    write_prior(output, config, prior_card(learnt, config, left_out))
    return {
        "output": str(output),
        "card": str(output.with_suffix(".md")),
        "scenes": [scene.name for scene in scenes],
        "left_out": left_out,
        "status": "ok",
    }


def write_prior(output: Path, config: TunedConfig, card: str) -> None:
    """Write the config, and its card beside it; both or neither.

    Raises:
        InputError, MachineError: they cannot be written.
    """
    with written_together(output.parent) as folder:
        write_text_whole(folder / output.with_suffix(".md").name, card)
        write_config(folder / output.name, config)


def scene_sources(library: Path | None, generated: int, seed: int) -> dict[str, Callable[[], Scene]]:
    """Map the name of each scene to a function that generates or reads it, with a camera and lights.

    Raises:
        InputError: the library cannot be read, or has no scene.
    """
    made = {generated_name(number): partial(generated_scene, number, seed) for number in range(generated)}
    files = {} if library is None else library_scenes(library, Path("out"))
    return made | {name: partial(library_scene, path, name) for name, path in files.items()}


def collected_scenes(
    sources: Mapping[str, Callable[[], Scene]], progress: Progress
) -> tuple[tuple[PriorScene, ...], dict[str, str]]:
    """The captures of all usable scenes, and the reason for each scene left out, by name.

    Raises:
        MachineError: there is no OpenGL, or the GPU ran out of memory.
    """
    # One context for all scenes: contexts that the runtimes created kept some 80 MiB each until the process
    # ended.
    context = create_context()
    found: list[PriorScene] = []
    left_out: dict[str, str] = {}
    for index, (name, made) in enumerate(sources.items()):
        progress(name, index / len(sources))
        try:
            scene = prior_scene(made(), context)
        except InputError as error:
            left_out[name] = str(error).rpartition(f"{name}: ")[2]
            continue
        # An unlit view teaches nothing and makes a mean over views meaningless.
        if (scene.table.square.max(axis=(1, 2, 3)) > 0.0).all():
            found.append(scene)
        else:
            left_out[name] = "no indirect light arrives in one of its views"
    return tuple(found), left_out


def library_scene(path: Path, name: str) -> Scene:
    """Read a scene and give it the camera and the lights that a fit would use.

    Raises:
        InputError: the scene or its sidecar cannot be used.
    """
    scene = with_environment(read_scene(path), path)
    camera, lights, _ = resolve_camera_and_lights(scene, path, None, None)
    return replace(scene, name=name, cameras=(camera,), lights=lights)


def _losses(
    scenes: tuple[PriorScene, ...], rows: TrainingRows, fits: OwnFits, unseen: tuple[AutoPrior, ...]
) -> dict[str, Float64[np.ndarray, "measures scenes counts splits"]]:
    scene = np.asarray(rows.scene)
    statistics = np.asarray(rows.statistics, np.float64)
    points = np.array([unseen[s].point(row) for s, row in zip(scene, statistics, strict=True)], np.float32)
    of_rows = {
        "auto": np.asarray(row_losses(rows, jnp.asarray(points))),
        "fit": np.asarray(rows.fit_loss),
        "default": np.asarray(rows.default_loss),
    }
    counts = np.concatenate([each.vpl_count for each in scenes])
    fitted = np.concatenate([each.fitted for each in scenes])

    def means(values: np.ndarray, s: int) -> list[list[np.ndarray]]:
        return [
            [
                values[:, (scene == s) & (counts == count) & (fitted == split)].mean(axis=1, dtype=np.float64)
                for split in (True, False)
            ]
            for count in fits.vpl_counts
        ]

    return {
        name: np.moveaxis(np.array([means(values, s) for s in range(len(scenes))]), -1, 0)
        for name, values in of_rows.items()
    }
