// The scene statistics: twelve ratios in [0, 1] that describe a lit scene, for config "auto".
//
// Provides: `scene_statistics`, indexed by STATISTIC_<NAME>, and `receiver_sums`, one for each workgroup.
// Constants: STATISTIC_COUNT and STATISTIC_<NAME>. Names and meanings: renderer/config/scene_statistics.py.
// Python: renderer/frame/passes/scene_statistics.py, which owns the buffer's size.

// Sums over receivers. `visible`, `near` and `range` of one receiver are means over its VPLs, weighted by their light.
struct ReceiverSums {
    float pairs;            // pairs of receiver and VPL
    float facing;           // pairs that face each other
    float receivers;        // receivers that get any light
    float visible;          // share of the light that the visibility maps let through
    float visible_squared;  // its square
    float near;             // l²/(d² + l²)
    float range;            // d/(d + L)
    float light;            // unoccluded light E at the receiver, in an arbitrary unit
    float light_squared;    // its square
};

// The neutral element of `added`.
const ReceiverSums NO_RECEIVERS = ReceiverSums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

layout(std430, binding = SCENE_STATISTICS_BINDING) buffer SceneStatistics {
    float scene_statistics[STATISTIC_COUNT];
    ReceiverSums receiver_sums[];  // one for each workgroup
};

ReceiverSums added(ReceiverSums a, ReceiverSums b) {
    return ReceiverSums(
        a.pairs + b.pairs, a.facing + b.facing, a.receivers + b.receivers, a.visible + b.visible,
        a.visible_squared + b.visible_squared, a.near + b.near, a.range + b.range, a.light + b.light,
        a.light_squared + b.light_squared);
}
