"""References of views, from the cache or rendered until their noise is low enough."""

from collections.abc import Callable

import numpy as np

from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View
from vpltune.tuner.reference import cache
from vpltune.tuner.reference.content_key import reference_key, scene_digest
from vpltune.tuner.reference.reference_view import ReferenceView, noise_between, noise_floor
from vpltune.tuner.reference.variant import describe_variant

FIRST_ROUND = 64
"""Samples per pixel and half before the first noise estimate; later rounds double the total. A choice."""

Progress = Callable[[str, float], None]
"""Called with a view's name and the share of the work done, in [0, 1]."""


def reference_views(
    scene: Scene,
    views: tuple[View, ...],
    *,
    seed: int = 0,
    noise_target: float = 1e-3,
    max_samples: int = 4096,
    bounces: int | None = None,
    progress: Progress | None = None,
) -> tuple[ReferenceView, ...]:
    """The reference of each view. Equal arguments, variant and versions give bit-identical results.

    Args:
        scene: Geometry, materials and environment. Its lights and cameras are ignored; each view brings its
            own.
        views: Cameras, lights and image sizes to render.
        seed: Seed of the randomisation of both halves, ≥ 0.
        noise_target: Sampling stops once `noise_floor`, and that of direct light, are at most this, ≥ 0.
        max_samples: Upper limit on samples per pixel in each half, ≥ 1.
        bounces: Reflections before light arrives at a receiver, ≥ 1; None for all. What is compared
            with a drawn image takes `light.most_bounces` of the config that it is drawn with.
        progress: Called with the view's name and the share of the total work done, in [0, 1].

    Raises:
        InputError: the scene has no triangles, an index in it is out of range, or a radiance is negative or
            not finite.
        ValueError: an argument is out of range.
    """
    if max_samples < 1 or not noise_target >= 0.0 or (bounces is not None and bounces < 1) or seed < 0:
        raise ValueError(
            "reference_views: max_samples and bounces must be at least 1, noise_target and seed at least 0, "
            f"got {max_samples}, {bounces}, {noise_target} and {seed}"
        )
    scene_hash = scene_digest(scene)
    variant = describe_variant().name
    references = []
    for index, view in enumerate(views):

        def report(share: float, view: View = view, index: int = index) -> None:
            if progress is not None:
                progress(view.name, (index + share) / len(views))

        report(0.0)
        key = reference_key(
            scene_hash,
            view,
            seed=seed,
            noise_target=noise_target,
            max_samples=max_samples,
            bounces=bounces,
            variant=variant,
        )
        reference = cache.load(key)
        if reference is None:
            with cache.locked(key):
                reference = cache.load(key)
                if reference is None:
                    reference = _rendered(scene, view, seed, noise_target, max_samples, bounces, report)
                    cache.store(key, reference)
        references.append(reference)
        report(1.0)
    return tuple(references)


def _rendered(
    scene: Scene,
    view: View,
    seed: int,
    noise_target: float,
    max_samples: int,
    bounces: int | None,
    report: Callable[[float], None],
) -> ReferenceView:
    # Imported here, so that a run whose references are all cached does not load Mitsuba.
    from vpltune.tuner.reference.indirect_irradiance import IndirectIrradiance
    from vpltune.tuner.reference.traced_scene import traced_scene

    traced = traced_scene(scene)
    estimator = IndirectIrradiance(traced, view)
    hits = estimator.primary_hits
    total, emitted = np.zeros((2, 2, *hits.albedo.shape))
    done, goal, needed = 0, min(FIRST_ROUND, max_samples), max_samples
    while True:
        for batch in estimator.batches(done, goal - done, seed, bounces):
            total += batch.irradiance
            emitted += 0.0 if batch.emitted is None else batch.emitted
            done += batch.samples
            report(min(1.0, done / needed))
        half_a, half_b = (total / done).astype(np.float32)
        direct = hits.direct_irradiance + (emitted / done).astype(np.float32)
        reference = ReferenceView(
            irradiance_a=half_a,
            irradiance_b=half_b,
            direct_irradiance=direct.mean(axis=0),
            albedo=hits.albedo,
            position_world=hits.position_world,
            normal_world=hits.normal_world,
            valid=hits.valid,
            samples=done,
            direct_noise_floor=noise_between(*direct[:, hits.valid]),
            emission=hits.emission,
        )
        floor = max(noise_floor(reference), reference.direct_noise_floor)
        if floor <= noise_target or done >= max_samples:
            return reference
        # The variance falls at least as fast as 1/samples.
        needed = max_samples if noise_target == 0.0 else min(max_samples, done * floor / noise_target)
        goal = min(2 * done, max_samples)
