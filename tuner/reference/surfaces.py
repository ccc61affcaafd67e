"""Surface points: position, normals and albedo where a ray hits the scene's triangles."""

from typing import Any, NamedTuple

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

    def ray_origin(self, wavefront, direction):
        """Origin for a ray that leaves along `direction`: `OFFSET` off the surface, on that side."""
        side = wavefront.dot(self.geometric_normal, direction)
        return self.position + self.geometric_normal * wavefront.where(side > 0.0, OFFSET, -OFFSET)


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

    def first_along(self, origin, direction, active) -> Surface:
        """The first surface along each active ray, with position and `origin` in unit space."""
        w = self.wavefront
        hit, triangle, b1, b2 = w.closest_hit(origin, direction, active)
        b0 = 1.0 - b1 - b2
        corners = w.take_vector(self._corners, triangle)

        def interpolated(table):
            return (
                w.take_vector(table, corners[0]) * b0
                + w.take_vector(table, corners[1]) * b1
                + w.take_vector(table, corners[2]) * b2
            )

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
        return Surface(hit, interpolated(self._positions), normal, geometric, albedo)

    def _interpolated_uv(self, corners, axis, b0, b1, b2):
        a, b, c = (self.wavefront.take(self._uv, corners[k] * 2 + axis) for k in range(3))
        return a * b0 + b * b1 + c * b2

    def _texture(self, row, u, v):
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
            packed = w.take(self._texels, first + line * width + column)
            return w.vector(*(w.take(self._linear, (packed >> shift) & 255) for shift in (0, 8, 16)))

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
