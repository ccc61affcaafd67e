"""Direct irradiance from spot, point and directional lights, with shadow rays."""

import numpy as np
from jaxtyping import Float32

from renderer.scene import Light
from tuner.reference.surfaces import Surface
from tuner.reference.unit_triangles import UnitTriangles

SHORTENING = 2.0**-13
"""A shadow ray stops this share of its length before a light, which may be set into a surface."""

_NUMBERS_PER_LIGHT = 12


def light_table(triangles: UnitTriangles, lights: tuple[Light, ...]) -> Float32[np.ndarray, "rows 4 3"]:
    """Lights in unit space. Rows: where the light is, the way it shines, its intensity, and
    (1 for a light at a place or 0 for one at infinity, scale and offset of the cone falloff).

    Falloff is clamp(cos θ · scale + offset, 0, 1)², as KHR_lights_punctual writes it; scale 0 and
    offset 1 make a light that has none. Where a light is at infinity, its place is the way to it.
    """
    # Never without a row: Dr.Jit cannot look anything up in an empty table, even where it never does.
    table = np.zeros((max(1, len(lights)), 4, 3))
    for row, light in zip(table, lights, strict=False):
        at_infinity = light.kind == "directional"
        row[0] = -light.direction_world if at_infinity else triangles.to_unit(light.position_world)
        row[1] = light.direction_world
        row[2] = triangles.unit_intensity(light)
        row[3] = [0.0 if at_infinity else 1.0, 0.0, 1.0]
        if light.kind == "spot":
            cos_outer = np.cos(light.outer_cone)
            # 1e-7: equal angles make a hard edge, and no division by zero.
            scale = 1.0 / max(np.cos(light.inner_cone) - cos_outer, 1e-7)
            row[3, 1:] = scale, -cos_outer * scale
    return table.astype(np.float32)


def direct_irradiance(wavefront, at: Surface, lights, light_count, active):
    """Irradiance (W/m²) that `lights` bring to the side of each surface that its normal points to.

    E = Σ I(ω)·max(0, cos θ)·V/d² for spot and point, E⊥·max(0, cos θ)·V for directional lights.
    """
    w = wavefront

    def add_light(index, irradiance):
        place, direction, intensity, shape = (w.take_vector(lights, index * 4 + row) for row in range(4))
        to_light = place - at.position * shape[0]
        # 1e-12: a millionth of the diagonal squared, nearer than any ray starts.
        squared = w.maximum(w.dot(to_light, to_light), 1e-12)
        distance = w.sqrt(squared)
        to_light = to_light / distance
        cosine = w.dot(at.shading_normal, to_light)
        cone = w.minimum(w.maximum(shape[2] - w.dot(to_light, direction) * shape[1], 0.0), 1.0)
        arriving = cone * cone * cosine / squared
        lit = active & (arriving > 0.0)
        max_t = w.where(shape[0] > 0.0, distance * (1.0 - SHORTENING), 1e30)
        blocked = w.occluded(at.ray_origin(w, to_light), to_light, max_t, lit)
        return index + 1, irradiance + intensity * w.where(lit & ~blocked, arriving, 0.0)

    zero = at.position * 0.0
    first = light_count * 0
    _, irradiance = w.loop(lambda index, _: index < light_count, add_light, (first, zero))
    return irradiance
