// The scene's vertices in world space, with skinning: shared by the geometry pass and the RSM pass.
//
// Provides: `scene_vertex`. Vertex inputs: in_position, in_normal, in_uv, in_color, in_instance.
// Python: renderer/gpu/scene_buffers.py, which owns the byte layout.

in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;
in vec3 in_color;
in int in_instance;

struct SceneInstance {
    mat4 to_world;
    mat4 normal_to_world;  // cofactors of to_world's linear part, scaled; the last row and column are unused
    vec4 base_color;
    ivec4 skinning;        // first influence, first vertex, influences per vertex (0: no skin), first joint
    vec4 alpha;            // opacity, cutoff, 1 if blended, number of the instance
    vec4 emission;         // radiance [W/(m² sr)]; 1 if both sides emit
};

layout(std430, binding = SCENE_INSTANCES_BINDING) readonly buffer SceneInstances {
    SceneInstance scene_instances[];
};

// The weight with which one vertex follows one joint.
struct SkinInfluence {
    int joint;
    float weight;
};

layout(std430, binding = SKIN_INFLUENCES_BINDING) readonly buffer SkinInfluences {
    SkinInfluence skin_influences[];
};

layout(std430, binding = JOINT_MATRICES_BINDING) readonly buffer JointMatrices {
    mat4 joint_matrices[];  // from the bind pose of the mesh to the world
};

struct SceneVertex {
    vec3 position_world;
    vec3 normal_world;
    vec3 base_color;
};

// Linear blend skinning: the weighted sum of the matrices of the vertex's joints.
mat4 blended_joints(ivec4 skinning) {
    int first = skinning.x + (gl_VertexID - skinning.y) * skinning.z;
    mat4 blended = mat4(0.0);
    for (int i = first; i < first + skinning.z; ++i) {
        blended += skin_influences[i].weight * joint_matrices[skinning.w + skin_influences[i].joint];
    }
    return blended;
}

// The cofactor matrix: transforms normals, also where `linear` mirrors.
mat3 normal_matrix(mat3 linear) {
    return mat3(cross(linear[1], linear[2]), cross(linear[2], linear[0]), cross(linear[0], linear[1]));
}

// The matrix times a power of two: its cofactors and their squares stay within float32, at any scale of the scene.
mat3 near_one(mat3 linear) {
    vec3 largest = max(max(abs(linear[0]), abs(linear[1])), abs(linear[2]));
    int exponent;
    frexp(max(max(largest.x, largest.y), largest.z), exponent);
    return linear * ldexp(1.0, -exponent);
}

// The vertex that this invocation draws.
SceneVertex scene_vertex() {
    SceneInstance instance = scene_instances[in_instance];
    mat4 to_world = instance.to_world;
    mat3 normal_to_world = mat3(instance.normal_to_world);
    if (instance.skinning.z > 0) {
        to_world = blended_joints(instance.skinning);
        normal_to_world = normal_matrix(near_one(mat3(to_world)));
    }
    SceneVertex vertex;
    vertex.position_world = (to_world * vec4(in_position, 1.0)).xyz;
    vertex.normal_world = normal_to_world * in_normal;
    if (instance.skinning.z > 0) {
        // Each vertex has its own matrix, whose scale must not act as a weight when normals are interpolated.
        float length_squared = dot(vertex.normal_world, vertex.normal_world);
        vertex.normal_world *= length_squared > 0.0 ? inversesqrt(length_squared) : 1.0;
    }
    vertex.base_color = instance.base_color.rgb * in_color;
    return vertex;
}
