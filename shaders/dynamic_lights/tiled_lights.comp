// Tiled lights, part 3: each tile selects its lights from those of its light-culling cell, a batch at a time, and adds
// up their irradiance.
//
// Reads: G-buffer, dynamic lights, tiles, cells. Writes: light accumulation, in units of `accumulation_unit` [W/m²].
// A batch is a set of bits in shared memory. So no list can overflow, and lights are always summed in the same order,
// which makes frames repeat bitwise.
// Constants: TILE_SIZE [pixels], CELL_TILES and TILE_BATCH of renderer/frame/passes/tiled_lights.py.
// Python: renderer/frame/passes/tiled_lights.py. Source: Andersson 2009; Harada 2012.
#include "common/light_culling.glsl"

layout(local_size_x = TILE_SIZE, local_size_y = TILE_SIZE) in;

layout(rgba16f, binding = ACCUMULATION_IMAGE) writeonly uniform image2D out_accumulation;

uniform int cell_columns;
uniform float accumulation_unit;

// A choice: the number of lights that one lane tests at a time. It keeps many lanes busy for 1,000 lights and needs few
// steps for 100,000. LANE_MASK has as many bits.
const int LANE_LIGHTS = 8;
const uint LANE_MASK = 0xffu;
const int WORDS = TILE_BATCH / 32;  // 32 lights in a word
shared uint words[WORDS];
shared uint filled_words[WORDS / 32];  // one bit for each word that is not 0

// One bit for each depth slice of the tile between two depths.
uint slices_between(float near_depth, float far_depth, LightTile tile) {
    uint first = depth_slice(near_depth, tile.nearest, tile.farthest);
    uint last = depth_slice(far_depth, tile.nearest, tile.farthest);
    return (0xffffffffu << first) & (0xffffffffu >> (31u - last));
}

// Whether a light may reach an occupied depth slice of the tile.
bool light_reaches_tile(DynamicLight light, ViewBlock block, LightTile tile) {
    if (!light_reaches(light, block)) {
        return false;
    }
    float depth = camera_position_depth(light.position_range.xyz).z;
    float range = light.position_range.w;
    return (slices_between(depth - range, depth + range, tile) & tile.occupied_slices) != 0u;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = imageSize(out_accumulation);
    int lane = int(gl_LocalInvocationIndex);
    LightTile tile = light_tiles[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x];
    vec2 first_pixel = vec2(gl_WorkGroupID.xy * uint(TILE_SIZE));
    ViewBlock block = view_block(first_pixel, first_pixel + TILE_SIZE, vec2(size), tile.nearest, tile.farthest);
    int words_per_cell = (light_count + 31) / 32;
    uvec2 cell = gl_WorkGroupID.xy / uint(CELL_TILES);
    int cell_word = int(cell.y * uint(cell_columns) + cell.x) * words_per_cell;
    Receiver receiver = gbuffer_receiver(min(pixel, size - 1));
    vec3 irradiance = vec3(0.0);
    int reaching_end = tile.nearest <= tile.farthest ? light_count : 0;
    for (int start = 0; start < reaching_end; start += TILE_BATCH) {
        for (int i = lane; i < WORDS; i += TILE_SIZE * TILE_SIZE) {
            words[i] = 0u;
        }
        if (lane < WORDS / 32) {
            filled_words[lane] = 0u;
        }
        barrier();
        int count = min(TILE_BATCH, light_count - start);
        for (int i = lane * LANE_LIGHTS; i < count; i += TILE_SIZE * TILE_SIZE * LANE_LIGHTS) {
            uint candidates = light_cells[cell_word + (start + i) / 32] & (LANE_MASK << (i % 32));
            uint reaching = 0u;
            for (; candidates != 0u; candidates &= candidates - 1u) {
                int bit = findLSB(candidates);
                if (light_reaches_tile(dynamic_lights[start + i / 32 * 32 + bit], block, tile)) {
                    reaching |= 1u << bit;
                }
            }
            if (reaching != 0u) {
                atomicOr(words[i / 32], reaching);
                atomicOr(filled_words[i / 1024], 1u << (i / 32 % 32));
            }
        }
        barrier();
        for (int group = 0; group < (count + 1023) / 1024; ++group) {
            for (uint filled = filled_words[group]; filled != 0u; filled &= filled - 1u) {
                int word = group * 32 + findLSB(filled);
                for (uint bits = words[word]; bits != 0u; bits &= bits - 1u) {
                    irradiance += dynamic_light_irradiance(
                        dynamic_lights[start + word * 32 + findLSB(bits)],
                        receiver.position_world, receiver.normal_world);
                }
            }
        }
        barrier();
    }
    if (all(lessThan(pixel, size))) {
        imageStore(out_accumulation, pixel, vec4(receiver.valid ? irradiance / accumulation_unit : vec3(0.0), 0.0));
    }
}
