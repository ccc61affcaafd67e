// Shadows of scenes with blended surfaces: the scene from one light face.
//
// Python: renderer/frame/passes/reflective_shadow_map.py.
#include "common/rsm_vertex.glsl"
