// Reflective shadow map: the scene from one light face.
//
// Reads: the scene's vertices and instances, light faces. Output: position, normal, uv and base colour in world space.
// Python: renderer/frame/passes/reflective_shadow_map.py. Source: Dachsbacher and Stamminger 2005.
#include "common/rsm_vertex.glsl"
