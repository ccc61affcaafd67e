// A learnt prior: parameters as a small function of the scene's statistics, eased over time. One workgroup, one
// invocation for each parameter. Twin: renderer/config/auto_prior.py.
#include "common/scene_statistics.glsl"

layout(local_size_x = AUTO_COUNT) in;

// An axis of the unit cube, from the parameter table.
struct AutoAxis {
    float low;
    float high;
    int logarithmic;
    int place;  // index of the parameter in the block
};

layout(std430, binding = AUTO_PRIOR_BINDING) readonly buffer AutoPriorWeights {
    float weights[AUTO_COUNT * STATISTIC_COUNT];
    float bias[AUTO_COUNT];
    float lowest[AUTO_COUNT];
    float highest[AUTO_COUNT];
    AutoAxis axes[AUTO_COUNT];
};

layout(std430, binding = AUTO_STATE_BINDING) buffer AutoState {
    int started;
    float point[AUTO_COUNT];  // in the unit cube, as of the last frame
};

// The block of common/artist_parameters.glsl, of which all members take four bytes.
layout(std430, binding = ARTIST_PARAMETERS_BINDING) buffer ArtistParameterValues {
    float parameter_values[];
};

uniform float adaptation;  // share of the way to the target that a frame goes, in (0, 1]; 1 goes all of it
uniform float largest_step;  // of an axis, that a frame goes at most

float target_of(int index) {
    float target = bias[index];
    for (int s = 0; s < STATISTIC_COUNT; ++s) {
        target += weights[index * STATISTIC_COUNT + s] * scene_statistics[s];
    }
    return clamp(target, lowest[index], highest[index]);
}

void main() {
    int index = int(gl_LocalInvocationIndex);
    float place = target_of(index);
    if (started != 0) {
        place = point[index] + clamp(adaptation * (place - point[index]), -largest_step, largest_step);
    }
    point[index] = place;
    AutoAxis axis = axes[index];
    float value = axis.logarithmic != 0
        ? axis.low * pow(axis.high / axis.low, place) : mix(axis.low, axis.high, place);
    parameter_values[axis.place] = clamp(value, axis.low, axis.high);
    barrier();
    if (index == 0) {
        started = 1;
    }
}
