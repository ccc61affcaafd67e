"""Irradiance from glowing surfaces and from the environment, with shadows.

    E(x) = ∫ L(x, ω) cos θ dω

L is the radiance that the surface which x sees along ω emits, or the environment's where x sees none. Two
strategies sample it: a cosine-weighted direction, and a point on a glowing surface or a direction of the
environment, drawn by how much light it gives. The balance heuristic combines them (Veach and Guibas 1995,
"Optimally Combining Sampling Techniques", eq. 9), so that no sample exceeds π times the largest radiance.
"""

import math

from vpltune.renderer.scene.environment import Environment
from vpltune.tuner.reference.environment_light import EnvironmentLight
from vpltune.tuner.reference.glowing_surfaces import GlowingSurfaces
from vpltune.tuner.reference.surfaces import Surface, Surfaces, cosine_density
from vpltune.tuner.reference.unit_triangles import UnitTriangles

_FAR = 1e30  # distance of the environment in scene diagonals: beyond everything
_LEAST_DENSITY = 1e-30  # only avoids 0/0: where both densities are zero, no light arrives


class EmittedLight:
    """What emits light of its own in a scene: `glowing` surfaces, a `sky`, or both."""

    def __init__(self, surfaces: Surfaces, glowing: GlowingSurfaces | None, sky: EnvironmentLight | None):
        self._surfaces, self._wavefront = surfaces, surfaces.wavefront
        self._glowing, self._sky = glowing, sky
        # Where there is both, each gets half of the samples. A choice: neither is starved, however bright the
        # other is where no surface hides it.
        self._sky_share = 0.0 if sky is None else 1.0 if glowing is None else 0.5

    def radiance(self, direction, y: Surface):
        """Radiance emitted towards the start of a ray along a unit vector that meets `y`, in W/(m² sr)."""
        w = self._wavefront
        met = y.glow[0] if self._glowing is not None else 0.0
        beyond = self._sky.arriving(direction)[0] if self._sky is not None else 0.0
        return w.where(y.hit, y.position * 0.0 + met, y.position * 0.0 + beyond)

    def from_cosine_direction(self, x: Surface, direction, y: Surface, alive):
        """Irradiance at x (W/m²) by one cosine-weighted direction, a unit vector along which x sees `y`."""
        w = self._wavefront
        arriving = x.position * 0.0
        if self._glowing is not None:
            radiance, triangle = y.glow
            density = cosine_density(w, x, y)
            drawn = self._glowing.density(triangle) * (1.0 - self._sky_share)
            weight = density / w.maximum(density + drawn, _LEAST_DENSITY)
            arriving = w.where(alive & y.hit, radiance * weight, arriving)
        if self._sky is not None:
            radiance, drawn = self._sky.arriving(direction)
            density = w.maximum(w.dot(x.shading_normal, direction), 0.0) / math.pi
            weight = density / w.maximum(density + drawn * self._sky_share, _LEAST_DENSITY)
            arriving = w.where(alive & ~y.hit, radiance * weight, arriving)
        return arriving * math.pi

    def from_light_sample(self, x: Surface, alive, u, v):
        """Irradiance at x (W/m²) by one point or direction, drawn with two numbers in [0, 1)."""
        w = self._wavefront
        if self._sky is None:
            way, reach, light = self._from_glowing(x, u, v)
        elif self._glowing is None:
            way, reach, light = self._from_sky(x, u, v)
        else:
            is_sky = u < self._sky_share
            place = w.where(is_sky, u / self._sky_share, (u - self._sky_share) / (1.0 - self._sky_share))
            way, reach, light = (
                w.where(is_sky, *pair)
                for pair in zip(self._from_sky(x, place, v), self._from_glowing(x, place, v), strict=True)
            )
        lit = alive & (w.dot(light, light) > 0.0)
        passing = self._surfaces.passing(x.ray_origin(w, way), way, reach, lit)
        return w.where(lit & (passing > 0.0), light * passing, 0.0)

    def _from_sky(self, x: Surface, u, v):
        """Way of the shadow ray from x, its reach in lengths of the way, and irradiance without shadows."""
        assert self._sky is not None
        w = self._wavefront
        direction = self._sky.direction(u, v)
        radiance, drawn = self._sky.arriving(direction)
        density = w.maximum(w.dot(x.shading_normal, direction), 0.0) / math.pi
        share = density / w.maximum(density + drawn * self._sky_share, _LEAST_DENSITY)
        return direction, w.where(density > 0.0, _FAR, 0.0), radiance * (share * math.pi)

    def _from_glowing(self, x: Surface, u, v):
        """As `_from_sky`. The way ends just off the surface that glows."""
        assert self._glowing is not None
        w = self._wavefront
        triangle, b1, b2 = self._glowing.point(u, v)
        to_y = self._surfaces.position(triangle, b1, b2) - x.position
        y = self._surfaces.at(True, triangle, b1, b2, to_y)
        density = cosine_density(w, x, y)
        drawn = self._glowing.density(triangle) * (1.0 - self._sky_share)
        share = (
            density / w.maximum(density + drawn, _LEAST_DENSITY) * self._surfaces.stopped(triangle, b1, b2)
        )
        way = y.ray_origin(w, -to_y) - x.ray_origin(w, to_y)
        return way, w.where(density > 0.0, 1.0, 0.0), y.glow[0] * (share * math.pi)


def emitted_light(
    surfaces: Surfaces, triangles: UnitTriangles, environment: Environment | None
) -> EmittedLight | None:
    """What emits light in a scene; None if nothing does.

    Raises:
        InputError: the environment is empty, negative or not finite.
    """
    glowing = GlowingSurfaces(surfaces, triangles) if triangles.glows else None
    sky = None if environment is None else EnvironmentLight(surfaces.wavefront, environment)
    if environment is not None and not environment.radiance.any():
        sky = None
    return None if glowing is None and sky is None else EmittedLight(surfaces, glowing, sky)
