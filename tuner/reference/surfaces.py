"""Surface points: position, normals and albedo where a ray hits the scene's triangles."""

import math
from typing import Any, NamedTuple

from vpltune.tuner.reference.sobol import hashed
from vpltune.tuner.reference.unit_triangles import WRAP_MODES, UnitTriangles, srgb_decode_table

OFFSET = 2.0**-17
"""Distance between a surface and the start of a ray that leaves it, in scene diagonals.

Positions are interpolated from corners of magnitude at most 1/2, and each step rounds by 2⁻²⁵. Embree's
robust test errs by a few units in the last place of the distance to the triangle. Together the error is below
1e-6. 2⁻¹⁷ ≈ 7.6e-6 is several times that, and 0.04 mm in a room of five metres."""


class Surface(NamedTuple):
    """One surface point per lane, in unit space. Only lanes with `hit` are meaningful."""

    hit: Any
    """Whether the ray met a surface."""
    position: Any
    shading_normal: Any
    """Unit length, flipped to the side that the ray came from."""
    geometric_normal: Any
    """Unit length, oriented by the winding of the triangle."""
    albedo: Any
    glow: Any = ()
    """(radiance that the ray meets, RGB in W/(m² sr); index of the triangle); empty if nothing glows."""

    def ray_origin(self, wavefront, direction):
        """Origin for a ray that leaves along `direction`: `OFFSET` off the surface, on that side."""
        side = wavefront.dot(self.geometric_normal, direction)
        return self.position + self.geometric_normal * wavefront.where(side > 0.0, OFFSET, -OFFSET)


def cosine_density(wavefront, x: Surface, y: Surface):
    """Density per unit area at y of cosine-weighted directions from x: max(0, cos θ_x)·|cos θ_y|/(π·d²)."""
    w = wavefront
    to_y = y.position - x.position
    squared = w.maximum(w.dot(to_y, to_y), 1e-20)
    slant = w.dot(y.geometric_normal, to_y)
    cosines = w.maximum(w.dot(x.shading_normal, to_y), 0.0) * w.maximum(slant, -slant)
    return cosines / (squared * squared * math.pi)


class Surfaces:
    """The triangles of a scene and their shading data, on one wavefront."""

    def __init__(self, wavefront, triangles: UnitTriangles):
        self.wavefront = wavefront
        self._corners = wavefront.table(triangles.triangles)
        self._positions = wavefront.table(triangles.positions)
        self._normals = wavefront.table(triangles.normals)
        self._colors = wavefront.table(triangles.colors)
        self._geometric_normals = wavefront.table(triangles.geometric_normals)
        self._textured = len(triangles.textures) > 1
        self._uv = wavefront.table(triangles.uv)
        self._texture_rows = wavefront.table(triangles.triangle_textures)
        self._textures = wavefront.table(triangles.textures)
        self._texels = wavefront.table(triangles.texels)
        self._linear = wavefront.table(srgb_decode_table())
        self._has_holes = triangles.has_holes
        self._alpha_rows = wavefront.table(triangles.triangle_alphas)
        self._alphas = wavefront.table(triangles.alphas)
        self._glows = triangles.glows
        self._glow_textured = bool(triangles.emission_textures.any())
        self._emission_rows = wavefront.table(triangles.triangle_emissions)
        self._emissions = wavefront.table(triangles.emissions)
        self._emission_textures = wavefront.table(triangles.emission_textures)

    def first_along(self, origin, direction, active, *, seen: bool = False) -> Surface:
        """The first surface along each active ray, with position and `origin` in unit space.

        Of blended surfaces, the first that stops the ray; or, for a camera's rays (`seen`), that it sees.
        """
        w = self.wavefront
        if self._has_holes:
            hit, triangle, b1, b2 = self._first_beyond_holes(origin, direction, active, seen)
        else:
            hit, triangle, b1, b2 = w.closest_hit(origin, direction, active)
        return self.at(hit, triangle, b1, b2, direction)

    def at(self, hit, triangle, b1, b2, direction) -> Surface:
        """The surface at barycentric coordinates of a triangle, met by a ray along `direction`, of any
        length."""
        w = self.wavefront
        b0 = 1.0 - b1 - b2
        corners = w.take_vector(self._corners, triangle)

        def interpolated(table):
            return self._interpolated(table, corners, b0, b1, b2)

        geometric = w.take_vector(self._geometric_normals, triangle)
        normal = interpolated(self._normals)
        squared = w.dot(normal, normal)
        # Below 1e-12 the vertex normals cancel or are zero: use the triangle's own normal.
        usable = squared > 1e-12
        normal = w.where(usable, normal / w.sqrt(w.maximum(squared, 1e-12)), geometric)
        normal = w.where(w.dot(normal, direction) > 0.0, -normal, normal)
        albedo = interpolated(self._colors)
        if self._textured:
            u = self._interpolated_uv(corners, 0, b0, b1, b2)
            v = self._interpolated_uv(corners, 1, b0, b1, b2)
            albedo = albedo * self._texture(w.take(self._texture_rows, triangle), u, v)
        glow = ()
        if self._glows:
            glow = (self._emitted(triangle, corners, b1, b2, geometric, direction), triangle)
        return Surface(hit, interpolated(self._positions), normal, geometric, albedo, glow)

    def position(self, triangle, b1, b2):
        """The point at barycentric coordinates of a triangle."""
        corners = self.wavefront.take_vector(self._corners, triangle)
        return self._interpolated(self._positions, corners, 1.0 - b1 - b2, b1, b2)

    def stopped(self, triangle, b1, b2):
        """Share of the light in [0, 1] that the surface stops at a point: 0 in a hole."""
        return self._stopped(triangle, b1, b2)[0] if self._has_holes else 1.0

    def _emitted(self, triangle, corners, b1, b2, geometric, direction):
        """Radiance that a ray along `direction` meets."""
        w = self.wavefront
        row = w.take(self._emission_rows, triangle)
        red, green, blue, side = (w.take(self._emissions, row * 4 + k) for k in range(4))
        # Negative where the ray runs against the normal of the side that glows.
        facing = (side == 0.0) | (side * w.dot(geometric, direction) < 0.0)
        radiance = w.where(facing, w.vector(red, green, blue), 0.0)
        if not self._glow_textured:
            return radiance
        u, v = (self._interpolated_uv(corners, axis, 1.0 - b1 - b2, b1, b2) for axis in range(2))
        return radiance * self._texture(w.take(self._emission_textures, row), u, v)

    def passing(self, origin, direction, max_t, active):
        """Share of the light in [0, 1] that comes through along each active ray; undefined for the others.

        A ray ends at `max_t` times the length of `direction`.
        """
        w = self.wavefront
        if not self._has_holes:
            return w.where(w.occluded(origin, direction, max_t, active), 0.0, 1.0)
        squared = w.dot(direction, direction)

        def pass_one(going, start, left, share):
            met, triangle, b1, b2 = w.closest_hit(start, direction, going, left)
            share = w.where(met, share * (1.0 - self._stopped(triangle, b1, b2)[0]), share)
            start = w.where(met, self._behind(triangle, b1, b2, direction), start)
            left = max_t - w.dot(start - origin, direction) / squared
            return going & met & (share > 0.0) & (left > 0.0), start, left, share

        nothing = squared * 0.0
        state = (active & (squared > 0.0), origin + direction * 0.0, nothing + max_t, nothing + 1.0)
        return w.loop(lambda going, *_: going, pass_one, state)[-1]

    def _first_beyond_holes(self, origin, direction, active, seen: bool):
        """As the wavefront's `closest_hit`, of points where there is no hole.

        A blended surface stops a ray with its opacity as the probability.
        """
        w = self.wavefront

        def pass_one(going, start, *_):
            met, triangle, b1, b2 = w.closest_hit(start, direction, going)
            share, is_seen = self._stopped(triangle, b1, b2)
            stops = met & (is_seen if seen else share > self._random(start, direction, triangle))
            start = w.where(met, self._behind(triangle, b1, b2, direction), start)
            return going & met & ~stops, start, stops, triangle, b1, b2

        nothing = direction[0] * 0.0
        going = active & (nothing == 0.0)
        state = (
            going,
            origin + direction * 0.0,
            going & (nothing > 0.0),
            w.to_index(nothing),
            nothing,
            nothing,
        )
        return w.loop(lambda going, *_: going, pass_one, state)[2:]

    def _stopped(self, triangle, b1, b2):
        """Share of the light in [0, 1] that a surface stops at a point, and whether a camera sees it."""
        w = self.wavefront
        row = w.take(self._alpha_rows, triangle)
        corners = w.take_vector(self._corners, triangle)
        u, v = (self._interpolated_uv(corners, axis, 1.0 - b1 - b2, b1, b2) for axis in range(2))
        texture = w.take(self._texture_rows, triangle)
        texel = self._filtered(texture, u, v, lambda packed: w.to_number(packed >> 24) / 255.0)
        opacity, cutoff, blended = (w.take(self._alphas, row * 3 + k) for k in range(3))
        is_seen = (row == 0) | (opacity * texel >= cutoff)
        return w.where(blended > 0.0, opacity * texel, w.where(is_seen, 1.0, 0.0)), is_seen

    def _random(self, start, direction, triangle):
        """A number in [0, 1) for each ray and triangle; rays that differ in a bit have unrelated ones."""
        w = self.wavefront
        mixed = triangle
        for vector in (start, direction):
            for axis in range(3):
                # An odd factor, 2³²/φ (Knuth), so that equal bits on two axes do not cancel.
                mixed = (mixed ^ w.bits(vector[axis])) * 0x9E3779B1
        return hashed(w, mixed, 0)

    def _behind(self, triangle, b1, b2, direction):
        """The start of a ray that goes on through a surface: `OFFSET` beyond it."""
        w = self.wavefront
        position = self.position(triangle, b1, b2)
        normal = w.take_vector(self._geometric_normals, triangle)
        return position + normal * w.where(w.dot(normal, direction) > 0.0, OFFSET, -OFFSET)

    def _interpolated(self, table, corners, b0, b1, b2):
        w = self.wavefront
        return (
            w.take_vector(table, corners[0]) * b0
            + w.take_vector(table, corners[1]) * b1
            + w.take_vector(table, corners[2]) * b2
        )

    def _interpolated_uv(self, corners, axis, b0, b1, b2):
        a, b, c = (self.wavefront.take(self._uv, corners[k] * 2 + axis) for k in range(3))
        return a * b0 + b * b1 + c * b2

    def _texture(self, row, u, v):
        """Bilinear lookup of decoded colours."""
        w = self.wavefront

        def color(packed):
            return w.vector(*(w.take(self._linear, (packed >> shift) & 255) for shift in (0, 8, 16)))

        return self._filtered(row, u, v, color)

    def _filtered(self, row, u, v, decoded):
        """Bilinear lookup of decoded texels. Texel centres lie at (i + 1/2)/size; v = 0 is the top."""
        w = self.wavefront
        first, width, height, wrap_u, wrap_v = (w.take(self._textures, row * 5 + k) for k in range(5))
        left, right, along_u = self._texel_pair(u, w.to_number(width), wrap_u)
        upper, lower, along_v = self._texel_pair(v, w.to_number(height), wrap_v)

        def texel(column, line):
            # Clamp as integers: a coordinate so large that its fraction is NaN must not read outside the
            # table.
            column = w.minimum(w.to_index(column), width - 1)
            line = w.minimum(w.to_index(line), height - 1)
            return decoded(w.take(self._texels, first + line * width + column))

        top = texel(left, upper) * (1.0 - along_u) + texel(right, upper) * along_u
        bottom = texel(left, lower) * (1.0 - along_u) + texel(right, lower) * along_u
        return top * (1.0 - along_v) + bottom * along_v

    def _texel_pair(self, coordinate, size, wrap):
        """The two texels on either side of a coordinate along one axis, and the weight of the second."""
        w = self.wavefront
        mirrored = wrap == WRAP_MODES.index("mirrored_repeat")
        clamped = wrap == WRAP_MODES.index("clamp_to_edge")
        period = w.where(mirrored, 2.0, 1.0)
        within = coordinate - period * w.floor(coordinate / period)
        within = w.where(clamped, w.minimum(w.maximum(coordinate, 0.0), 1.0), within)
        place = within * size - 0.5
        before = w.floor(place)

        def wrapped(texel):
            around = texel - size * period * w.floor(texel / (size * period))
            around = w.where(around >= size, 2.0 * size - 1.0 - around, around)
            return w.maximum(w.where(clamped, texel, around), 0.0)

        return wrapped(before), wrapped(before + 1.0), place - before
