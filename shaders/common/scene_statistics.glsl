// What is measured of a lit scene each frame; names and meanings in renderer/config/scene_statistics.py.

struct ReceiverSums {
    float pairs;
    float facing;
    float receivers;
    float visible;
    float visible_squared;
    float near;
    float range;
    float light;
    float light_squared;
};

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
