// Sky light, part 2: the rays that are worth casting from each tile. One workgroup for each tile.
//
// Reads: bits and numbers of the tiles. Writes: the candidates of each tile.
// Constants: SKY_WORDS, SKY_REACH (tiles to each side). Python: renderer/frame/passes/sky_light.py.
//
// A ray is a candidate if it, or a neighbour of it in the sky, was open from a tile nearby. The tile itself does not count:
// candidates depend on other rays than its own, so that what these show of all rays but the candidates has no bias.

layout(local_size_x = 64) in;

layout(std430, binding = SKY_PROBES_BINDING) readonly buffer SkyProbes {
    uint sky_probes[];  // as in sky_probes.comp
};

layout(std430, binding = SKY_CANDIDATES_BINDING) writeonly buffer SkyCandidates {
    uvec2 sky_candidates[];  // as in sky_light.comp
};

uniform int ray_count;

shared uint words[SKY_WORDS];

void main() {
    int lane = int(gl_LocalInvocationIndex);
    ivec2 tiles = ivec2(gl_NumWorkGroups.xy);
    ivec2 tile = ivec2(gl_WorkGroupID.xy);
    ivec2 low = max(tile - SKY_REACH, ivec2(0));
    ivec2 high = min(tile + SKY_REACH, tiles - 1);
    for (int word = lane; word < SKY_WORDS; word += 64) {
        uint open = 0u;
        for (int y = low.y; y <= high.y; ++y) {
            for (int x = low.x; x <= high.x; ++x) {
                if (x != tile.x || y != tile.y) {
                    open |= sky_probes[(y * tiles.x + x) * (1 + SKY_WORDS) + 1 + word];
                }
            }
        }
        int rest = ray_count - 32 * word;
        words[word] = (open | open << 1 | open >> 1) & (rest >= 32 ? 0xffffffffu : (1u << rest) - 1u);
    }
    barrier();
    if (lane != 0) {
        return;
    }
    uvec2 open_blocked = uvec2(0u);
    for (int y = low.y; y <= high.y; ++y) {
        for (int x = low.x; x <= high.x; ++x) {
            uint counts = sky_probes[(y * tiles.x + x) * (1 + SKY_WORDS)];
            open_blocked += uvec2(counts & 0xffffu, counts >> 16);
        }
    }
    int start = (tile.y * tiles.x + tile.x) * (1 + SKY_WORDS);
    uint before = 0u;
    for (int word = 0; word < SKY_WORDS; ++word) {
        sky_candidates[start + 1 + word] = uvec2(words[word], before);
        before += uint(bitCount(words[word]));
    }
    sky_candidates[start] = uvec2(before, open_blocked.x >= open_blocked.y ? 1u : 0u);
}
