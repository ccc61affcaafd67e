// Web page: one triangle that covers the whole target. The vertex shader of every pass that works on pixels or texels.
void main() {
    gl_Position = vec4(float(gl_VertexID & 1) * 4.0 - 1.0, float(gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0);
}
