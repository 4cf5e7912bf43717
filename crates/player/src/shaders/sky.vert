// One triangle that covers the picture. Host: version and precision stand before this.

// From the lower edge (-1) to the upper one.
out float row;

void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    row = corner.y;
    gl_Position = vec4(corner, 1.0, 1.0);
}
