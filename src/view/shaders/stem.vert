// A length of a stem between two cross-sections; see export/lengths.rs. Host: version and precision stand before this.

// Corner of the outline: place (x, y) and normal (z, w), in parts of the radius.
in vec4 spoke;
// Which end (0 or 1); of a cap: sine and cosine of the latitude, and its side (-1 start, 1 end, 0 no cap).
in vec4 part;
in vec3 centre0;
in vec3 u0;
in vec3 v0;
in vec3 centre1;
in vec3 u1;
in vec3 v1;
in vec4 color;

uniform mat4 view;
uniform mat4 projection;

out vec3 seen;
out vec3 facing;
out vec3 shade;

vec3 direction(vec3 v, vec3 otherwise) {
    float length2 = dot(v, v);
    return length2 > 0.0 ? v * inversesqrt(length2) : otherwise;
}

void main() {
    bool second = part.x > 0.5;
    vec3 centre = second ? centre1 : centre0;
    vec3 u = second ? u1 : u0;
    vec3 v = second ? v1 : v0;
    vec3 outward0 = u0 * spoke.x + v0 * spoke.y;
    vec3 outward1 = u1 * spoke.x + v1 * spoke.y;
    vec3 outward = second ? outward1 : outward0;
    // Where a stem ends in a point, directions are those of the other end.
    bool point = dot(u, u) == 0.0;
    vec3 du = point ? (second ? u0 : u1) : u;
    vec3 dv = point ? (second ? v0 : v1) : v;
    vec3 along = direction(cross(du * 1e3, dv * 1e3), direction(centre1 - centre0, vec3(0.0, 1.0, 0.0)));
    vec3 around = direction(dv * spoke.z - du * spoke.w, vec3(1.0, 0.0, 0.0));
    vec3 place;
    vec3 normal;
    if (part.w == 0.0) {
        place = centre + outward;
        // At a right angle to the outline and to the side, which tapers.
        vec3 side = along * length(centre1 - centre0) + outward1 - outward0;
        normal = direction(cross(around, side), along);
    } else {
        place = centre + outward * part.z + along * (part.w * part.y * length(u));
        normal = cross(around, along) * part.z + along * (part.w * part.y);
    }
    vec4 at = view * vec4(place, 1.0);
    seen = at.xyz;
    facing = mat3(view) * normal;
    shade = color.rgb;
    gl_Position = projection * at;
}
