"""Plain path tracing of indirect irradiance: the peer that our frames are measured against.

It is what Mitsuba's `path` integrator computes from an irradiance meter at every pixel: a cosine-weighted
direction, then a shadow ray to every light from what it meets (Kajiya 1986, "The Rendering Equation").
`IndirectIrradiance` adds paths from the lights to it.
"""

from vpltune.tuner.reference.directions import cosine_direction
from vpltune.tuner.reference.indirect_irradiance import IndirectIrradiance
from vpltune.tuner.reference.surfaces import Surface


class PlainPathTracing(IndirectIrradiance):
    """As `IndirectIrradiance`, by cosine-weighted directions and shadow rays alone."""

    def _from_cosine_direction(self, x: Surface, alive, reflects, u, v):
        direction = cosine_direction(self._wavefront, x.shading_normal, u, v)
        y = self._surfaces.first_along(x.ray_origin(self._wavefront, direction), direction, alive)
        return y, self._lights.irradiance(y, reflects & y.hit), direction

    def _from_light_path(self, x: Surface, alive, chosen, u, v):
        return x.position * 0.0
