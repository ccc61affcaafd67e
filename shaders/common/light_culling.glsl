// Light culling: which dynamic lights may reach which part of the view. Parts are tiles of pixels, and light-culling
// cells of CELL_TILES x CELL_TILES tiles.
//
// Provides: `light_tiles`, `light_cells`, `view_block`, `light_reaches`.
// Python: renderer/frame/passes/tiled_lights.py. Source: Harada 2012 for the slices of depth ("2.5D culling").
#include "common/dynamic_lights.glsl"
#include "common/gbuffer.glsl"

// The surfaces that the camera sees in one tile.
struct LightTile {
    float nearest;         // distances along the view axis [world units]; nearest > farthest where nothing is seen
    float farthest;
    uint occupied_slices;  // of 32 equal slices of depth from nearest to farthest
    uint padding;
};

layout(std430, binding = LIGHT_TILES_BINDING) buffer LightTiles {
    LightTile light_tiles[];
};

// For each cell, one bit for each light that may reach it.
layout(std430, binding = LIGHT_CELLS_BINDING) buffer LightCells {
    uint light_cells[];
};

uniform int light_count;

// The index of the depth slice, 0 to 31: one bit of a uint each.
uint depth_slice(float depth, float nearest, float farthest) {
    float share = (depth - nearest) / max(farthest - nearest, 1e-30);
    return uint(clamp(share * 32.0, 0.0, 31.0));
}

// A part of the view frustum: a rectangle of pixels between two depths. Camera space, with depth = -z as third axis.
struct ViewBlock {
    vec2 low;  // the rectangle at unit depth
    vec2 high;
    float nearest;
    float farthest;
    vec3 box_low;  // bounding box; its z is depth
    vec3 box_high;
};

ViewBlock view_block(vec2 first_pixel, vec2 end_pixel, vec2 image_size, float nearest, float farthest) {
    ViewBlock block;
    block.low = (first_pixel / image_size * 2.0 - 1.0) * tan_half_fov;
    block.high = (end_pixel / image_size * 2.0 - 1.0) * tan_half_fov;
    block.nearest = nearest;
    block.farthest = farthest;
    block.box_low = vec3(min(block.low * nearest, block.low * farthest), nearest);
    block.box_high = vec3(max(block.high * nearest, block.high * farthest), farthest);
    return block;
}

// Camera space, with depth as third axis.
vec3 camera_position_depth(vec3 position_world) {
    vec3 position_camera = transpose(mat3(camera_to_world)) * (position_world - camera_to_world[3].xyz);
    return vec3(position_camera.xy, -position_camera.z);
}

// Sphere against the block's four side planes, which all pass through the eye, and against its bounding box, which
// rejects spheres near the corners that no single plane rejects.
bool sphere_reaches(vec3 center, float radius, ViewBlock block) {
    vec4 beyond = vec4(block.low * center.z - center.xy, center.xy - block.high * center.z);
    vec4 side = radius * sqrt(1.0 + vec4(block.low * block.low, block.high * block.high));
    vec3 away = center - clamp(center, block.box_low, block.box_high);
    return all(lessThanEqual(beyond, side)) && dot(away, away) <= radius * radius;
}

// Cone against the bounding sphere of the block (Wronski 2017, "Cull that cone!").
bool cone_reaches(vec3 apex, vec3 axis, float cos_outer, ViewBlock block) {
    vec3 center = 0.5 * (block.box_low + block.box_high);
    float radius = 0.5 * distance(block.box_low, block.box_high);
    vec3 offset = center - apex;
    float along = dot(offset, axis);
    float across = sqrt(max(dot(offset, offset) - along * along, 0.0));
    return cos_outer * across - along * sqrt(1.0 - cos_outer * cos_outer) <= radius && along >= -radius;
}

// Whether a light may reach the block. Conservative: it may say yes where the light does not.
bool light_reaches(DynamicLight light, ViewBlock block) {
    vec3 center = camera_position_depth(light.position_range.xyz);
    if (!sphere_reaches(center, light.position_range.w, block)) {
        return false;
    }
    if (light.intensity_cos_outer.w < -1.0) {
        return true;
    }
    vec3 axis = transpose(mat3(camera_to_world)) * light.direction_cone_scale.xyz;
    return cone_reaches(center, vec3(axis.xy, -axis.z), light.intensity_cos_outer.w, block);
}
