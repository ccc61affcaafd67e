"""Small fits with a known answer: boxes lit by VPLs, with misfit and noise as real ones have.

The image of each view is the full gather's at the planted parameters, times a smooth field exp(s·g) that no
parameter can follow (g Gaussian with a random correlation length, the same in all channels), with independent
noise in each half of the reference. What is planted is then what the views tell, give or take what the
intervals must cover.
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.fitting.fit_views import FitView, fit_view
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather
from vpltune.tuner.surrogate.wide_vectors import wide_jit

SIZE = (48, 36)
"""Of each view: 1,728 receivers at most."""
VIEWS = 2
VPLS = 32

_gather = wide_jit(gather)


@dataclass(frozen=True, eq=False)
class PlantedProblem:
    """What a fit is given, and the answer."""

    views: tuple[FitView, ...]
    planted: ArtistParameters


def planted_problem(seed: int) -> PlantedProblem:
    """A room, its lights, its parameters and its errors, all from `seed`."""
    random = np.random.default_rng([seed, 0x5EED])
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
    halves = [
        np.maximum(image * (1.0 + noise * random.standard_normal(image.shape)), 0.0).astype(np.float32)
        for _ in range(2)
    ]
    pixels = np.arange(SIZE[0] * SIZE[1])
    return fit_view(receivers, vpls, None, *halves, pixels, SIZE)


def _seen(random: np.random.Generator, half_size: Float[np.ndarray, "3"]) -> Receivers:
    """What a camera inside the box sees of its walls, row by row."""
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
    # Where a ray meets each pair of walls; the nearest is what is seen.
    reach = (np.sign(rays) * half_size - eye) / rays
    wall = reach.argmin(axis=1)
    position = eye + rays * reach.min(axis=1)[:, None]
    normal = -np.eye(3)[wall] * np.sign(rays[np.arange(len(rays)), wall])[:, None]
    return Receivers(jnp.asarray(position, jnp.float32), jnp.asarray(normal, jnp.float32))


def _lit_patch(random: np.random.Generator, half_size: Float[np.ndarray, "3"]) -> VirtualPointLights:
    """VPLs on a disc of light folded about an edge of the box, those farther out standing for more area."""
    along, first, second = random.permutation(3)
    sides = random.choice([-1.0, 1.0], 2)
    radius = random.uniform(0.5, 0.9) * half_size.min()
    reach = radius * np.sqrt((np.arange(VPLS) + 0.5) / VPLS)
    angle = 2.399963 * np.arange(VPLS)
    off_edge = reach * np.sin(angle) + random.uniform(-0.7, 0.7) * radius
    position, normal = np.zeros((VPLS, 3)), np.zeros((VPLS, 3))
    position[:, along] = reach * np.cos(angle) + random.uniform(-0.3, 0.3) * half_size[along]
    # Beyond the edge, light goes on along the other wall.
    position[:, first] = sides[0] * (half_size[first] - np.maximum(off_edge, 0.0))
    position[:, second] = sides[1] * (half_size[second] - np.maximum(-off_edge, 0.0))
    normal[off_edge > 0.0, second] = -sides[1]
    normal[off_edge <= 0.0, first] = -sides[0]
    area = 1.0 + 2.0 * (reach / radius) ** 2
    footprint = radius * np.sqrt(area / area.sum())
    flux = random.uniform(0.2, 1.0, 3)[None, :] * np.ones((VPLS, 1)) / VPLS
    return VirtualPointLights(*(jnp.asarray(v, jnp.float32) for v in (position, normal, footprint, flux)))


def _smooth_field(random: np.random.Generator) -> Float[np.ndarray, "height width"]:
    """Gaussian, of mean 0 and variance 1 over many draws."""
    length = random.uniform(0.02, 0.15) * SIZE[0]
    margin = int(4 * length) + 1
    field = random.standard_normal((SIZE[1] + 2 * margin, SIZE[0] + 2 * margin))
    # The variance of white noise under a Gaussian filter of width s is 1/(4πs²).
    field = gaussian_filter(field, length, mode="wrap") * np.sqrt(4.0 * np.pi) * length
    return field[margin:-margin, margin:-margin]
