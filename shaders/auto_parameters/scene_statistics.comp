// Scene statistics, part 1: how receivers relate to VPLs, summed over the receivers of a workgroup.
//
// Reads: G-buffer, VPLs, frame statistics, and visibility maps if VISIBILITY_MAP_SIZE > 0.
// Writes: `receiver_sums`, one for each workgroup. One invocation for each receiver, a pixel.
// Constants: STATISTICS_* and R2_STEP_* of renderer/frame/passes/scene_statistics.py; the counts come from
// renderer/config/scene_statistics.py, which explains each statistic.
// Python: renderer/frame/passes/scene_statistics.py. Twin: tuner/surrogate/scene_statistics.py.
#include "common/gbuffer.glsl"
#include "common/scene_length.glsl"
#include "common/scene_statistics.glsl"
#include "common/virtual_point_lights.glsl"
#if VISIBILITY_MAP_SIZE > 0
#include "common/vpl_visibility.glsl"
#endif

layout(local_size_x = STATISTICS_GROUP_SIZE) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) readonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform int vpl_count;

shared ReceiverSums sums[STATISTICS_GROUP_SIZE];

// Share of a VPL's unoccluded light that its visibility map lets through; 1 without maps. Bias and softness are the
// table's defaults and not the frame's, because these statistics set the frame's.
float seen(Receiver receiver, VirtualPointLight vpl, int index) {
#if VISIBILITY_MAP_SIZE > 0
    return vpl_visibility(
        receiver.position_world, receiver.normal_world, vpl,
        index * (VISIBILITY_MAP_SIZE * VISIBILITY_MAP_SIZE), scene_length,
        VisibilityParameters(STATISTICS_BIAS, STATISTICS_SOFTNESS));
#else
    return 1.0;
#endif
}

// The sums of one receiver, over every STATISTICS_STRIDE-th VPL from `first`. The weight of a pair is
// Φ cosθ_x cosθ_j/(d² + l²).
ReceiverSums measured(Receiver receiver, int first, int end) {
    ReceiverSums result = NO_RECEIVERS;
    float light = 0.0;
    vec3 weighed = vec3(0.0);  // sums of visible, near and range, weighted by light
    for (int j = first; j < end; j += STATISTICS_STRIDE) {
        VirtualPointLight vpl = virtual_point_lights[j];
        vec3 to_vpl = vpl.position_footprint.xyz - receiver.position_world;
        float distance_squared = max(dot(to_vpl, to_vpl), 1e-30);
        float cosines = max(dot(receiver.normal_world, to_vpl), 0.0) * max(-dot(vpl.normal_area.xyz, to_vpl), 0.0);
        float footprint_squared = vpl.position_footprint.w * vpl.position_footprint.w;
        float flux = (vpl.flux.r + vpl.flux.g + vpl.flux.b) / total_flux;
        float form = cosines / distance_squared / (distance_squared + footprint_squared);
        float weight = flux * form * scene_length * scene_length;
        result.pairs += 1.0;
        // 1e-4 is a choice for the product of both cosines. Below it, receiver and VPL lie in one plane, and rounding
        // decides whether they face each other.
        if (weight > 0.0 && cosines > 1e-4 * distance_squared) {
            result.facing += 1.0;
            light += weight;
            float range = sqrt(distance_squared);
            weighed += weight * vec3(
                seen(receiver, vpl, j),
                footprint_squared / (distance_squared + footprint_squared),
                range / (range + scene_length));
        }
    }
    if (light > 0.0) {
        vec3 mean = weighed / light;
        result.receivers = 1.0;
        result.visible = mean.x;
        result.visible_squared = mean.x * mean.x;
        result.near = mean.y;
        result.range = mean.z;
        result.light = light;
        result.light_squared = light * light;
    }
    return result;
}

void main() {
    int lane = int(gl_LocalInvocationIndex);
    int index = int(gl_GlobalInvocationID.x);
    ivec2 size = textureSize(gbuffer_depth, 0);
    // The R2 sequence (Roberts 2018): evenly spread pixels, the same ones in every frame.
    vec2 point = fract(0.5 + float(index) * vec2(R2_STEP_X, R2_STEP_Y));
    Receiver receiver = gbuffer_receiver(min(ivec2(point * vec2(size)), size - 1));
    bool lit = total_flux > 0.0;
    sums[lane] = receiver.valid && lit
        ? measured(receiver, index % STATISTICS_STRIDE, min(vpl_count, STATISTICS_VPLS)) : NO_RECEIVERS;
    barrier();
    for (int reach = STATISTICS_GROUP_SIZE / 2; reach > 0; reach /= 2) {
        if (lane < reach) { sums[lane] = added(sums[lane], sums[lane + reach]); }
        barrier();
    }
    if (lane == 0) {
        receiver_sums[gl_WorkGroupID.x] = sums[0];
    }
}
