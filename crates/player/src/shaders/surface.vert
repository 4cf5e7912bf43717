// A corner of a triangle, in its place. Host: version, precision, shade.glsl and open.glsl stand before this.

in vec3 corner;
in vec3 normal;
// And whether light comes through.
in vec4 color;

uniform mat4 view;
uniform mat4 projection;

out vec3 seen;
out vec3 facing;
out vec4 shade;
// The light of the sky on the side of the normal and on the other one.
out vec2 open;

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
    shade = color;
#ifdef RECEIVES
    open = vec2(open_side(corner, normal), open_side(corner, -normal));
#else
    open = 0.5 + vec2(0.5, -0.5) * normal.y;
#endif
#ifdef PICTURES
    place = pin.xy;
    picture = pin.z;
#endif
    gl_Position = projection * at;
}
