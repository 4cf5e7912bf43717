// A corner of a triangle, in its place. Host: version and precision stand before this.

in vec3 corner;
in vec3 normal;
in vec4 color;

uniform mat4 view;
uniform mat4 projection;

out vec3 seen;
out vec3 facing;
out vec3 shade;

#ifdef PICTURES
// The place in a picture, and twice the number of that, plus 1 if it repeats; negative without a picture.
in vec3 pin;
out vec2 place;
flat out float picture;
#endif

void main() {
    vec4 at = view * vec4(corner, 1.0);
    seen = at.xyz;
    facing = mat3(view) * normal;
    shade = color.rgb;
#ifdef PICTURES
    place = pin.xy;
    picture = pin.z;
#endif
    gl_Position = projection * at;
}
