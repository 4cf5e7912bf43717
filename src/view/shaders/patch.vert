// A bicubic Bezier patch; each row of its control points is three vectors of four numbers.

in vec2 place;
in vec4 row0a;
in vec4 row0b;
in vec4 row0c;
in vec4 row1a;
in vec4 row1b;
in vec4 row1c;
in vec4 row2a;
in vec4 row2b;
in vec4 row2c;
in vec4 row3a;
in vec4 row3b;
in vec4 row3c;
in vec4 color;

uniform mat4 view;
uniform mat4 projection;

out vec3 seen;
out vec3 facing;
out vec3 shade;

vec4 weights(float t) {
    float s = 1.0 - t;
    return vec4(s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t);
}

vec4 slopes(float t) {
    float s = 1.0 - t;
    return 3.0 * vec4(-s * s, s * s - 2.0 * s * t, 2.0 * s * t - t * t, t * t);
}

vec3 along(vec4 a, vec4 b, vec4 c, vec4 w) {
    return a.xyz * w.x + vec3(a.w, b.xy) * w.y + vec3(b.zw, c.x) * w.z + c.yzw * w.w;
}

vec3 sum(vec4 columns, vec4 rows) {
    return along(row0a, row0b, row0c, columns) * rows.x + along(row1a, row1b, row1c, columns) * rows.y
        + along(row2a, row2b, row2c, columns) * rows.z + along(row3a, row3b, row3c, columns) * rows.w;
}

vec3 front(vec2 at) {
    return cross(sum(slopes(at.x), weights(at.y)), sum(weights(at.x), slopes(at.y)));
}

void main() {
    vec3 normal = front(place);
    vec3 size = sum(vec4(-1.0, 0.0, 0.0, 1.0), vec4(0.5, 0.0, 0.0, 0.5));
    // Where an edge shrinks to a point, the normal of a place nearby.
    if (dot(normal, normal) <= 1e-8 * dot(size, size) * dot(size, size)) {
        normal = front(mix(place, vec2(0.5), 0.05));
    }
    vec4 at = view * vec4(sum(weights(place.x), weights(place.y)), 1.0);
    seen = at.xyz;
    facing = mat3(view) * (normal * inversesqrt(max(dot(normal, normal), 1e-30)));
    shade = color.rgb;
    gl_Position = projection * at;
}
