// The triangles of glowing surfaces as they stand, and what they emit.
//
// Provides: `glowing_triangle`. Python: renderer/gpu/glowing_triangles.py, which owns the bytes.

// In the mesh's own space. The colour is the radiance [W/(m² sr)].
struct StoredGlowingTriangle {
    vec3 a;
    float red;
    vec3 b;
    float green;
    vec3 c;
    float blue;
    int place;  // the matrix that places it
    int sides;  // 1, or 2 if the back emits too
    int padding[2];
};

layout(std430, binding = GLOWING_TRIANGLES_BINDING) readonly buffer GlowingTriangles {
    StoredGlowingTriangle glowing_triangles[];
};

layout(std430, binding = GLOWING_PLACES_BINDING) readonly buffer GlowingPlaces {
    mat3x4 glowing_places[];  // columns are the rows of the affine matrix to the world
};

// In the world.
struct GlowingTriangle {
    vec3 a;
    vec3 to_b;
    vec3 to_c;
    vec3 normal;    // unit, on the side from where the corners run counter-clockwise: that side emits
    float area;     // of one side [world units²]
    vec3 radiance;  // [W/(m² sr)]
    float sides;
};

GlowingTriangle glowing_triangle(int index) {
    StoredGlowingTriangle stored = glowing_triangles[index];
    mat3x4 place = glowing_places[stored.place];
    vec3 a = vec4(stored.a, 1.0) * place;
    vec3 to_b = vec4(stored.b, 1.0) * place - a;
    vec3 to_c = vec4(stored.c, 1.0) * place - a;
    vec3 across = cross(to_b, to_c);
    float twice_area = length(across);
    // 1e-30 keeps the quotient finite.
    return GlowingTriangle(
        a, to_b, to_c, across / max(twice_area, 1e-30), 0.5 * twice_area,
        vec3(stored.red, stored.green, stored.blue), float(stored.sides));
}

// What a triangle emits, as the mean of the channels, in units of π watts.
float glowing_power(GlowingTriangle triangle) {
    vec3 radiance = triangle.radiance;
    return triangle.area * triangle.sides * (radiance.r + radiance.g + radiance.b) / 3.0;
}
