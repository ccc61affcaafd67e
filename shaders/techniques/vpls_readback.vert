// One triangle that covers the image. Python: renderer/techniques/vpls_readback.py.
void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = vec4(corner * 4.0 - 1.0, 0.5, 1.0);
}
