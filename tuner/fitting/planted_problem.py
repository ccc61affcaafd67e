"""Small fit problems with a known answer: boxes lit by VPLs, with misfit and noise as real scenes have them.

A planted problem tells whether a fit works: the fitted parameters must come close to the planted ones, and
the intervals must contain them as often as they claim.

The image of a view is the full gather's at the planted parameters, times a smooth field exp(s·g) that no
parameter can follow. g is a Gaussian random field with a random correlation length, the same in all channels.
Each half of the reference has independent noise.

Example:
    >>> problem = planted_problem(seed=0)
    >>> tuned, _, intervals = fit_with_intervals(problem.views, ArtistParameters())
    >>> intervals["intensity"].low <= problem.planted.intensity <= intervals["intensity"].high
    True
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.fitting.fit_views import FitView, fit_view
from vpltune.tuner.fitting.uncertainty import fit_with_intervals
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather
from vpltune.tuner.surrogate.wide_vectors import wide_jit

SIZE = (48, 36)
"""Width and height of a view in pixels: 1,728 receivers. A choice: small, to fit many problems."""
VIEWS = 2
"""Views of a problem. A choice."""
VPLS = 32
"""VPLs of a view. A choice."""
_GOLDEN_ANGLE = 2.399963
"""π·(3 − √5) radians: turned by it, points on a spiral spread evenly over a disc."""
_SEED_WORD = 0x5EED
"""Keeps these random streams apart from others that start from the same seed. A choice."""

_gather = wide_jit(gather)


@dataclass(frozen=True, eq=False)
class PlantedProblem:
    """What a fit is given, and the parameters that it should find."""

    views: tuple[FitView, ...]
    planted: ArtistParameters


@dataclass(frozen=True, eq=False)
class IntervalCoverage:
    """Which intervals contain the planted value, problem by problem."""

    names: tuple[str, ...]
    """The fitted parameters, in the order of the columns."""
    contains: Bool[np.ndarray, "problems parameters"]
    determined: Bool[np.ndarray, "problems parameters"]
    """Whether the fit called the parameter determined."""


def planted_problem(seed: int) -> PlantedProblem:
    """Draw a room, its VPLs, its parameters and its errors at random from `seed`."""
    random = np.random.default_rng([seed, _SEED_WORD])
    planted = ArtistParameters(
        intensity=float(np.exp(random.uniform(np.log(0.5), np.log(2.0)))),
        falloff_footprint=float(np.exp(random.uniform(np.log(0.3), np.log(3.0)))),
        extinction_coefficient=float(random.uniform(0.0, 1.5)),
    )
    half_size = random.uniform(0.6, 1.6, 3)
    misfit = random.uniform(0.02, 0.2)
    noise = random.uniform(0.02, 0.06)
    views = tuple(_view(random, half_size, planted, misfit, noise) for _ in range(VIEWS))
    return PlantedProblem(views, planted)


def interval_coverage(problems: int, progress: Callable[[float], None] | None = None) -> IntervalCoverage:
    """Fit the planted problems of seeds 0 to `problems` − 1 from the defaults, and check their intervals.

    Args:
        progress: called with the share done, in [0, 1].
    """
    names: tuple[str, ...] = ()
    contains, determined = [], []
    for seed in range(problems):
        problem = planted_problem(seed)
        _, _, intervals = fit_with_intervals(problem.views, ArtistParameters())
        truth = problem.planted.as_dict()
        names = tuple(intervals)
        contains.append([each.low <= truth[name] <= each.high for name, each in intervals.items()])
        determined.append([each.determined for each in intervals.values()])
        if progress is not None:
            progress((seed + 1) / problems)
    return IntervalCoverage(names, np.array(contains), np.array(determined))


def _view(
    random: np.random.Generator,
    half_size: Float[np.ndarray, "3"],
    planted: ArtistParameters,
    misfit: float,
    noise: float,
) -> FitView:
    receivers = _seen(random, half_size)
    vpls = _lit_patch(random, half_size)
    image = np.asarray(_gather(receivers, vpls, FalloffParameters.of(planted)))
    image = image * np.exp(misfit * _smooth_field(random).reshape(-1, 1))
    half_a, half_b = (
        np.maximum(image * (1.0 + noise * random.standard_normal(image.shape)), 0.0).astype(np.float32)
        for _ in range(2)
    )
    return fit_view(receivers, vpls, None, half_a, half_b, np.arange(SIZE[0] * SIZE[1]), SIZE)


def _seen(random: np.random.Generator, half_size: Float[np.ndarray, "3"]) -> Receivers:
    """The points of the box's walls that a camera inside it sees, row by row."""
    eye = random.uniform(-0.8, 0.8, 3) * half_size
    forward = -eye + 0.3 * random.standard_normal(3)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 1.0, 1e-3])
    right /= np.linalg.norm(right)
    across, down = np.meshgrid(*(np.linspace(-1.0, 1.0, count) for count in SIZE))
    rays = (
        forward
        + 0.9 * across.ravel()[:, None] * right
        - 0.7 * down.ravel()[:, None] * np.cross(right, forward)
    )
    # The distance at which a ray meets each pair of walls; the nearest wall is the one that is seen.
    reach = (np.sign(rays) * half_size - eye) / rays
    wall = reach.argmin(axis=1)
    position = eye + rays * reach.min(axis=1)[:, None]
    normal = -np.eye(3)[wall] * np.sign(rays[np.arange(len(rays)), wall])[:, None]
    return Receivers(jnp.asarray(position, jnp.float32), jnp.asarray(normal, jnp.float32))


def _lit_patch(random: np.random.Generator, half_size: Float[np.ndarray, "3"]) -> VirtualPointLights:
    """VPLs on a lit disc that is folded about an edge of the box; those farther out stand for more area."""
    along, first, second = random.permutation(3)
    sides = random.choice([-1.0, 1.0], 2)
    radius = random.uniform(0.5, 0.9) * half_size.min()
    reach = radius * np.sqrt((np.arange(VPLS) + 0.5) / VPLS)
    angle = _GOLDEN_ANGLE * np.arange(VPLS)
    off_edge = reach * np.sin(angle) + random.uniform(-0.7, 0.7) * radius
    position, normal = np.zeros((VPLS, 3)), np.zeros((VPLS, 3))
    position[:, along] = reach * np.cos(angle) + random.uniform(-0.3, 0.3) * half_size[along]
    # Beyond the edge, the disc continues on the other wall.
    position[:, first] = sides[0] * (half_size[first] - np.maximum(off_edge, 0.0))
    position[:, second] = sides[1] * (half_size[second] - np.maximum(-off_edge, 0.0))
    normal[off_edge > 0.0, second] = -sides[1]
    normal[off_edge <= 0.0, first] = -sides[0]
    area = 1.0 + 2.0 * (reach / radius) ** 2
    footprint = radius * np.sqrt(area / area.sum())
    flux = random.uniform(0.2, 1.0, 3)[None, :] * np.ones((VPLS, 1)) / VPLS
    return VirtualPointLights(
        jnp.asarray(position, jnp.float32),
        jnp.asarray(normal, jnp.float32),
        jnp.asarray(footprint, jnp.float32),
        jnp.asarray(flux, jnp.float32),
    )


def _smooth_field(random: np.random.Generator) -> Float[np.ndarray, "height width"]:
    """A Gaussian random field with mean 0 and variance 1 over many draws."""
    length = random.uniform(0.02, 0.15) * SIZE[0]
    margin = int(4 * length) + 1
    field = random.standard_normal((SIZE[1] + 2 * margin, SIZE[0] + 2 * margin))
    # The variance of white noise under a Gaussian filter of width s is 1/(4πs²).
    field = gaussian_filter(field, length, mode="wrap") * np.sqrt(4.0 * np.pi) * length
    return field[margin:-margin, margin:-margin]
