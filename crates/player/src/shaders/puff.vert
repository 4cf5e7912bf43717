// A blob of gas as a square that faces the viewer. Host: version and precision stand before this.

in vec3 centre;
in float deviation;
// Its optical depth, and how much of it is shown.
in vec2 depth;
in vec3 light;

uniform mat4 view;
uniform mat4 projection;

// In standard deviations.
out vec2 aside;
flat out vec2 thick;
flat out vec3 shade;

const float REACH = 3.0;

void main() {
    aside = REACH * (2.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0);
    thick = depth;
    shade = light;
    vec4 at = view * vec4(centre, 1.0);
    at.xy += deviation * aside;
    gl_Position = projection * at;
}
