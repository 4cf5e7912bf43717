// A corner of a triangle, in its place. Host: version and precision stand before this.

in vec3 corner;
in vec3 normal;
in vec4 color;

uniform mat4 view;
uniform mat4 projection;

out vec3 seen;
out vec3 facing;
out vec3 shade;

void main() {
    vec4 at = view * vec4(corner, 1.0);
    seen = at.xyz;
    facing = mat3(view) * normal;
    shade = color.rgb;
    gl_Position = projection * at;
}
