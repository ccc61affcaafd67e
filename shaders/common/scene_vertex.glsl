// The scene's vertices and where they stand in the world: what geometry and RSM passes have in common.

in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;
in vec3 in_color;
in int in_instance;

struct SceneInstance {
    mat4 to_world;
    mat4 normal_to_world;  // cofactors of to_world's linear part; the last row and column are unused
    vec4 base_color;
};

layout(std430, binding = SCENE_INSTANCES_BINDING) readonly buffer SceneInstances {
    SceneInstance scene_instances[];
};

struct SceneVertex {
    vec3 position_world;
    vec3 normal_world;
    vec3 base_color;
};

SceneVertex scene_vertex() {
    SceneInstance instance = scene_instances[in_instance];
    SceneVertex vertex;
    vertex.position_world = (instance.to_world * vec4(in_position, 1.0)).xyz;
    vertex.normal_world = mat3(instance.normal_to_world) * in_normal;
    vertex.base_color = instance.base_color.rgb * in_color;
    return vertex;
}
