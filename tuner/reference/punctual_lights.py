"""Spot, point and directional lights: the irradiance from them, and light paths that start at them."""

import math

import numpy as np
from jaxtyping import Float32

from vpltune.renderer.scene.light_range import inverse_range
from vpltune.renderer.scene.scene import Light
from vpltune.renderer.scene.spot_cone import cone_scale
from vpltune.tuner.reference.directions import cone_direction, disc_point
from vpltune.tuner.reference.surfaces import Surface, Surfaces
from vpltune.tuner.reference.unit_triangles import UnitTriangles

SHORTENING = 2.0**-13
"""A shadow ray ends this share of its length before the light, which may sit in a surface. A choice."""

BEAM_RADIUS = 0.51
"""Radius of the disc from which directional light paths start. A scene of diagonal 1 fits into its beam,
which needs 0.5; the rest is a margin."""

_ROWS = 5  # vectors for each light; see _light_table


class PunctualLights:
    """The lights of one view in unit space, and the surfaces that shadow them."""

    def __init__(self, surfaces: Surfaces, triangles: UnitTriangles, lights: tuple[Light, ...]):
        wavefront = surfaces.wavefront
        self._surfaces = surfaces
        self._wavefront = wavefront
        self._table = wavefront.table(_light_table(triangles, lights))
        self.count = wavefront.table(np.array([len(lights)], np.uint32))

    def _row(self, index, row: int):
        return self._wavefront.take_vector(self._table, index * _ROWS + row)

    def arriving(self, index, at: Surface):
        """How light `index` reaches each surface, without shadows.

        E = I(ω)·max(0, cos θ)·max(0, 1 − (d/range)⁴)/d² for spot and point lights, E⊥·max(0, cos θ) for
        directional ones.

        Returns:
            Unit vector to the light; distance (1e30 for a directional light); irradiance E in W/m² on the
            side of the shading normal; density of the light's paths per unit area of the surface.
        """
        w = self._wavefront
        place, direction, intensity, falloff, density = (self._row(index, row) for row in range(_ROWS))
        to_light = place - at.position * falloff[0]
        # 1e-12 is a millionth of the diagonal, squared: closer than any ray starts.
        squared = w.maximum(w.dot(to_light, to_light), 1e-12)
        distance = w.sqrt(squared)
        to_light = to_light / distance
        cone = w.minimum(w.maximum(falloff[2] - w.dot(to_light, direction) * falloff[1], 0.0), 1.0)
        cosine = w.maximum(w.dot(at.shading_normal, to_light), 0.0)
        slant = w.dot(at.geometric_normal, to_light)
        paths = density[0] * w.maximum(slant, -slant) / squared
        reach = w.where(falloff[0] > 0.0, distance, 1e30)
        # Exactly 1 without a range: what such a light gives has every bit of before.
        ratio = squared * density[2] * density[2]
        left = w.maximum(1.0 - ratio * ratio, 0.0)
        return to_light, reach, intensity * (cone * cone * cosine / squared * left), paths

    def irradiance(self, at: Surface, active, weight=None):
        """Irradiance from all lights in W/m², with shadows; 0 in lanes that are not `active`.

        `weight` maps the density of a light's paths to a factor on its contribution; None means 1.
        """
        w = self._wavefront

        def add_light(index, total):
            to_light, reach, irradiance, paths = self.arriving(index, at)
            lit = active & (w.dot(irradiance, irradiance) > 0.0)
            origin = at.ray_origin(w, to_light)
            passing = self._surfaces.passing(origin, to_light, reach * (1.0 - SHORTENING), lit)
            share = passing if weight is None else passing * weight(paths)
            return index + 1, total + w.where(lit & (passing > 0.0), irradiance * share, 0.0)

        state = (self.count * 0, at.position * 0.0)
        return w.loop(lambda index, _: index < self.count, add_light, state)[1]

    def emitted(self, index, u, v):
        """Origin and direction of a path from light `index`, with the density that `arriving` returns."""
        w = self._wavefront
        place, direction, falloff, density = (self._row(index, row) for row in (0, 1, 3, 4))
        placed = falloff[0] > 0.0
        beam = disc_point(w, direction, u, v) * BEAM_RADIUS - direction
        return w.where(placed, place, beam), w.where(
            placed, cone_direction(w, direction, density[1], u, v), direction
        )


def _light_table(triangles: UnitTriangles, lights: tuple[Light, ...]) -> Float32[np.ndarray, "lights 5 3"]:
    """Five vectors for each light, in unit space:

    0. position, or for a directional light the unit vector towards it;
    1. unit direction in which it shines;
    2. intensity;
    3. (1, or 0 for a directional light; scale of the cone falloff; offset of the cone falloff);
    4. (density of its paths per steradian, or per unit area of the beam; cosine of the widest angle; inverse
       of its range, 0 without one).

    The cone falloff is clamp(cos θ·scale + offset, 0, 1)², as in KHR_lights_punctual. Scale 0 and offset 1
    turn it off.
    """
    # At least one row: Dr.Jit cannot compile a lookup into an empty table, even one that never runs.
    table = np.zeros((max(1, len(lights)), _ROWS, 3))
    for row, light in zip(table, lights, strict=False):
        at_infinity = light.kind == "directional"
        row[0] = -light.direction_world if at_infinity else triangles.to_unit(light.position_world)
        row[1] = light.direction_world
        row[2] = triangles.unit_intensity(light)
        row[3] = [0.0 if at_infinity else 1.0, 0.0, 1.0]
        least = -1.0
        if light.kind == "spot":
            least = np.cos(light.outer_cone)
            scale = cone_scale(light.inner_cone, light.outer_cone)
            row[3, 1:] = scale, -least * scale
        area = BEAM_RADIUS**2 if at_infinity else 2.0 * (1.0 - least)
        row[4] = [1.0 / (math.pi * area), least, inverse_range(light, triangles.diagonal)]
    return table.astype(np.float32)
