// Auto parameters: a learnt prior sets the artist parameters from the scene statistics, eased over time.
//
// Reads: the scene statistics, the prior's weights, the state of the last frame.
// Writes: the artist parameters that the prior knows, and the state. One workgroup, one invocation for each parameter.
// Constants: AUTO_COUNT and STATISTIC_COUNT, from renderer/frame/passes/auto_parameters.py.
// Python: renderer/frame/passes/auto_parameters.py; renderer/config/auto_prior.py holds the formula, clamp(W s + b).
// Twin: tuner/prior/prior_training.py.
#include "common/scene_statistics.glsl"

layout(local_size_x = AUTO_COUNT) in;

// The range of one parameter: an axis of the unit cube.
struct AutoAxis {
    float low;
    float high;
    int logarithmic;  // 1 or 0
    int place;        // index of the parameter in the parameter block
};

layout(std430, binding = AUTO_PRIOR_BINDING) readonly buffer AutoPriorWeights {
    float weights[AUTO_COUNT * STATISTIC_COUNT];
    float bias[AUTO_COUNT];
    float lowest[AUTO_COUNT];
    float highest[AUTO_COUNT];
    AutoAxis axes[AUTO_COUNT];
};

layout(std430, binding = AUTO_STATE_BINDING) buffer AutoState {
    int started;              // 0 before the first frame
    float point[AUTO_COUNT];  // the parameters in the last frame, in the unit cube
};

// The block of common/artist_parameters.glsl as an array: every member takes four bytes.
layout(std430, binding = ARTIST_PARAMETERS_BINDING) buffer ArtistParameterValues {
    float parameter_values[];
};

uniform float adaptation;    // share of the way to the target that one frame moves, in (0, 1]
uniform float largest_step;  // the most that one frame moves, as a share of the axis

// Where the prior wants a parameter, in the unit cube.
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
