// A surface in its place: its origin, its first and its second axis, of its size.

in vec3 corner;
in vec3 normal;
// Colour of the surface itself; its fourth number is 1 where the thing's colour, if it has one, replaces it.
in vec4 own;
in vec3 origin;
in vec3 first;
in vec3 second;
// The fourth number is 0 if the thing has no colour.
in vec4 color;

uniform mat4 view;
uniform mat4 projection;

out vec3 seen;
out vec3 facing;
out vec3 shade;

void main() {
    float scale = length(first);
    vec3 third = scale > 0.0 ? cross(first / scale, second) : vec3(0.0);
    mat3 axes = mat3(first, second, third);
    vec4 at = view * vec4(origin + axes * corner, 1.0);
    seen = at.xyz;
    facing = mat3(view) * (axes * normal) / max(scale, 1e-30);
    shade = mix(own.rgb, color.rgb, own.a * color.a);
    gl_Position = projection * at;
}
