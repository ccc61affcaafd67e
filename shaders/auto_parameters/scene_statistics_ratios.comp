// Scene statistics, part 2: from sums over receivers, and from moments of the lit VPLs, to ratios. One workgroup.
//
// Reads: `receiver_sums` of part 1, VPLs, frame statistics. Writes: `scene_statistics`.
// Constants: STATISTICS_* and STATISTIC_* of renderer/frame/passes/scene_statistics.py. The 16 that divides log2 of the
// VPL count is log2 of the largest count, 65,536.
// Python: renderer/frame/passes/scene_statistics.py. Twin: tuner/surrogate/scene_statistics.py.
#include "common/scene_length.glsl"
#include "common/scene_statistics.glsl"
#include "common/virtual_point_lights.glsl"

layout(local_size_x = STATISTICS_GROUP_SIZE) in;

layout(std430, binding = VIRTUAL_POINT_LIGHTS_BINDING) readonly buffer VirtualPointLights {
    VirtualPointLight virtual_point_lights[];
};

uniform int vpl_count;

// Sums over the lit VPLs. Positions are in units of L, relative to the first VPL. Φ is a VPL's share of the total flux.
struct Moments {
    vec4 position_flux;   // Σ Φ·position, ΣΦ
    vec3 squares;         // Σ Φ·(xx, yy, zz)
    vec3 products;        // Σ Φ·(xy, xz, yz)
    vec3 normal;          // Σ Φ·normal
    vec4 pairs;           // Σ cosθ_i·cosθ_j over pairs of VPLs, number of pairs; Σ l/(l + L), number of lit VPLs
};

shared Moments sums[STATISTICS_GROUP_SIZE];

float share_of_flux(VirtualPointLight vpl) {
    return (vpl.flux.r + vpl.flux.g + vpl.flux.b) / (3.0 * total_flux);
}

// How directly a VPL faces the next STATISTICS_PARTNERS of the sequence: Σ cosθ_i·cosθ_j, and the number of pairs.
vec2 shine_on_each_other(VirtualPointLight vpl, int index, int count) {
    vec2 result = vec2(0.0);
    for (int k = 1; k <= STATISTICS_PARTNERS; ++k) {
        VirtualPointLight other = virtual_point_lights[(index + k) % count];
        vec3 between = other.position_footprint.xyz - vpl.position_footprint.xyz;
        float length_squared = dot(between, between);
        if (share_of_flux(other) > 0.0 && length_squared > 0.0) {
            float cosines = max(dot(vpl.normal_area.xyz, between), 0.0)
                          * max(-dot(other.normal_area.xyz, between), 0.0) / length_squared;
            result += vec2(cosines, 1.0);
        }
    }
    return result;
}

// The sums of one invocation: every STATISTICS_GROUP_SIZE-th VPL.
Moments moments_of(int lane, int count) {
    Moments result = Moments(vec4(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec4(0.0));
    for (int i = lane; i < count; i += STATISTICS_GROUP_SIZE) {
        VirtualPointLight vpl = virtual_point_lights[i];
        float flux = share_of_flux(vpl);
        if (flux > 0.0) {
            vec3 place = (vpl.position_footprint.xyz - virtual_point_lights[0].position_footprint.xyz) / scene_length;
            result.position_flux += flux * vec4(place, 1.0);
            result.squares += flux * place * place;
            result.products += flux * place.xxy * place.yzz;
            result.normal += flux * vpl.normal_area.xyz;
            float footprint = vpl.position_footprint.w;
            result.pairs += vec4(shine_on_each_other(vpl, i, count), footprint / (footprint + scene_length), 1.0);
        }
    }
    return result;
}

// `part` / `whole` in [0, 1]; 0 where there is nothing.
float ratio(float part, float whole) {
    return whole > 0.0 ? clamp(part / whole, 0.0, 1.0) : 0.0;
}

// From sums to ratios. Each formula stands beside its name in renderer/config/scene_statistics.py.
void write_ratios(Moments moments) {
    ReceiverSums receivers = NO_RECEIVERS;
    for (int i = 0; i < STATISTICS_GROUPS; ++i) { receivers = added(receivers, receiver_sums[i]); }
    float count = receivers.receivers;
    float visible = count > 0.0 ? receivers.visible / count : 1.0;
    float variance = max(ratio(receivers.visible_squared, count) - visible * visible, 0.0);
    scene_statistics[STATISTIC_VISIBLE] = visible;
    scene_statistics[STATISTIC_VISIBLE_SPREAD] = min(2.0 * sqrt(count > 0.0 ? variance : 0.0), 1.0);
    scene_statistics[STATISTIC_NEAR] = ratio(receivers.near, count);
    scene_statistics[STATISTIC_DISTANCE] = ratio(receivers.range, count);
    scene_statistics[STATISTIC_FACING] = ratio(receivers.facing, receivers.pairs);
    scene_statistics[STATISTIC_EVENNESS] = ratio(receivers.light * receivers.light, count * receivers.light_squared);

    float flux = max(moments.position_flux.w, 1e-30);
    vec3 mean = moments.position_flux.xyz / flux;
    // The covariance of the lit positions: c on the diagonal, o off it (xy, xz, yz).
    vec3 c = max(moments.squares / flux - mean * mean, 0.0);
    vec3 o = moments.products / flux - mean.xxy * mean.yzz;
    float trace = c.x + c.y + c.z;
    float minors = c.x * c.y + c.x * c.z + c.y * c.z - dot(o, o);
    float determinant = c.x * (c.y * c.z - o.z * o.z) - o.x * (o.x * c.z - o.z * o.y) + o.y * (o.x * o.z - c.y * o.y);
    scene_statistics[STATISTIC_ROUNDNESS] = ratio(27.0 * determinant, trace * trace * trace);
    scene_statistics[STATISTIC_FLATNESS] = ratio(3.0 * minors, trace * trace);
    scene_statistics[STATISTIC_COHERENCE] = ratio(length(moments.normal), moments.position_flux.w);
    scene_statistics[STATISTIC_CONCAVITY] = ratio(moments.pairs.x, moments.pairs.y);
    scene_statistics[STATISTIC_FOOTPRINT] = ratio(moments.pairs.z, moments.pairs.w);
    scene_statistics[STATISTIC_VPL_COUNT] = log2(float(vpl_count)) / 16.0;
}

void main() {
    int lane = int(gl_LocalInvocationIndex);
    int count = total_flux > 0.0 ? min(vpl_count, STATISTICS_MOMENT_VPLS) : 0;
    sums[lane] = moments_of(lane, count);
    barrier();
    for (int reach = STATISTICS_GROUP_SIZE / 2; reach > 0; reach /= 2) {
        if (lane < reach) {
            Moments other = sums[lane + reach];
            sums[lane].position_flux += other.position_flux;
            sums[lane].squares += other.squares;
            sums[lane].products += other.products;
            sums[lane].normal += other.normal;
            sums[lane].pairs += other.pairs;
        }
        barrier();
    }
    if (lane == 0) {
        write_ratios(sums[0]);
    }
}
