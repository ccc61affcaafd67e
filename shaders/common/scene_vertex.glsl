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
    ivec4 skinning;  // first influence, first vertex, influences per vertex (0: no skin), first joint
};

layout(std430, binding = SCENE_INSTANCES_BINDING) readonly buffer SceneInstances {
    SceneInstance scene_instances[];
};

// How much one vertex follows one joint.
struct SkinInfluence {
    int joint;
    float weight;
};

layout(std430, binding = SKIN_INFLUENCES_BINDING) readonly buffer SkinInfluences {
    SkinInfluence skin_influences[];
};

layout(std430, binding = JOINT_MATRICES_BINDING) readonly buffer JointMatrices {
    mat4 joint_matrices[];  // from the mesh as it was bound to the world
};

struct SceneVertex {
    vec3 position_world;
    vec3 normal_world;
    vec3 base_color;
};

// Linear blend skinning: the weighted sum of the joints' matrices.
mat4 blended_joints(ivec4 skinning) {
    int first = skinning.x + (gl_VertexID - skinning.y) * skinning.z;
    mat4 blended = mat4(0.0);
    for (int i = first; i < first + skinning.z; ++i) {
        blended += skin_influences[i].weight * joint_matrices[skinning.w + skin_influences[i].joint];
    }
    return blended;
}

// Cofactors: what carries normals, for mirrored matrices too.
mat3 normal_matrix(mat3 linear) {
    return mat3(cross(linear[1], linear[2]), cross(linear[2], linear[0]), cross(linear[0], linear[1]));
}

SceneVertex scene_vertex() {
    SceneInstance instance = scene_instances[in_instance];
    mat4 to_world = instance.to_world;
    mat3 normal_to_world = mat3(instance.normal_to_world);
    if (instance.skinning.z > 0) {
        to_world = blended_joints(instance.skinning);
        normal_to_world = normal_matrix(mat3(to_world));
    }
    SceneVertex vertex;
    vertex.position_world = (to_world * vec4(in_position, 1.0)).xyz;
    vertex.normal_world = normal_to_world * in_normal;
    if (instance.skinning.z > 0) {
        // Each vertex has a matrix of its own: their sizes must not weigh in the interpolation.
        float length_squared = dot(vertex.normal_world, vertex.normal_world);
        vertex.normal_world *= length_squared > 0.0 ? inversesqrt(length_squared) : 1.0;
    }
    vertex.base_color = instance.base_color.rgb * in_color;
    return vertex;
}
