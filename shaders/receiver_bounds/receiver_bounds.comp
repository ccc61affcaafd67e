// Receiver bounds: groups the pixels of a tile by the axis that their normal is nearest to and by their distance, and
// lists a box around each group. Together the boxes hold every receiver. One workgroup for each tile.
//
// A single box around a tile that sees an edge would reach from the near surface to the far one, and hold most VPLs.
//
// Reads: G-buffer. Writes: `receiver_bounds`.
// Constants: RECEIVER_TILE [pixels], RECEIVER_DISTANCE_STEPS, both of renderer/frame/passes/receiver_bounds.py.
// Python: the same file.
#include "common/gbuffer.glsl"
#include "common/receiver_bounds.glsl"

layout(local_size_x = RECEIVER_TILE, local_size_y = RECEIVER_TILE) in;

const int PIXELS = RECEIVER_TILE * RECEIVER_TILE;

// A hash table with a slot for each group. A tile has no more groups than pixels.
shared uint keys[PIXELS];  // 0: free
// Of each slot the least and greatest of six numbers, position and normal, in the order of floats.
shared uint least[6 * PIXELS];
shared uint greatest[6 * PIXELS];

// Unsigned integers in the order of the floats.
uint ordered(float value) {
    uint bits = floatBitsToUint(value);
    return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

// The inverse of `ordered`.
float unordered(uint bits) {
    return uintBitsToFloat((bits & 0x80000000u) != 0u ? bits & 0x7FFFFFFFu : ~bits);
}

// The group of a receiver, from 1. `depth` as stored, in (0, 1].
uint group_of(vec3 normal, float depth) {
    vec3 size = abs(normal);
    int axis = size.x >= max(size.y, size.z) ? 0 : size.y >= size.z ? 1 : 2;
    uint side = normal[axis] > 0.0 ? 1u : 0u;
    // Rounding may take the depth of the near plane above 1.
    uint steps = uint(max(-log(depth) * RECEIVER_DISTANCE_STEPS, 0.0));
    return (steps * 3u + uint(axis)) * 2u + side + 1u;
}

// The slot of a group: its own, or a free one that it takes.
uint slot_of(uint key) {
    uint slot = key % uint(PIXELS);
    while (true) {
        uint found = atomicCompSwap(keys[slot], 0u, key);
        if (found == 0u || found == key) {
            return slot;
        }
        slot = (slot + 1u) % uint(PIXELS);
    }
    return 0u;
}

void include_number(uint index, float value) {
    atomicMin(least[index], ordered(value));
    atomicMax(greatest[index], ordered(value));
}

vec3 three(uint first, bool of_greatest) {
    vec3 values;
    for (uint i = 0u; i < 3u; ++i) {
        values[i] = unordered(of_greatest ? greatest[first + i] : least[first + i]);
    }
    return values;
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    keys[lane] = 0u;
    for (uint i = 6u * lane; i < 6u * lane + 6u; ++i) {
        least[i] = 0xFFFFFFFFu;
        greatest[i] = 0u;
    }
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, textureSize(gbuffer_depth, 0)))) {
        Receiver receiver = gbuffer_receiver(pixel);
        if (receiver.valid) {
            uint slot = slot_of(group_of(receiver.normal_world, texelFetch(gbuffer_depth, pixel, 0).r));
            for (int i = 0; i < 3; ++i) {
                include_number(6u * slot + uint(i), receiver.position_world[i]);
                include_number(6u * slot + 3u + uint(i), receiver.normal_world[i]);
            }
        }
    }
    barrier();
    if (keys[lane] != 0u) {
        uint index = atomicAdd(receiver_bounds_count, 1u);
        if (index < uint(receiver_bounds.length())) {
            uint first = 6u * lane;
            receiver_bounds[index] = ReceiverBounds(
                vec4(three(first, false), 0.0), vec4(three(first, true), 0.0),
                vec4(three(first + 3u, false), 0.0), vec4(three(first + 3u, true), 0.0));
        }
    }
}
