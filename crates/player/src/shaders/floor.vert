// A place of the rigid floor. Host: version, precision, shade.glsl and open.glsl stand before this.

// From the middle, in parts of how far shadows of the sky reach; those outermost are as far as the floor is seen.
in vec2 corner;

uniform mat4 view;
uniform mat4 projection;
uniform float height;
uniform float around;
uniform float extent;

out vec3 at;
// The part of the sky that is seen.
out float open;
// How far it is beyond the place where the floor begins to fade, in parts of the distance within which half of its colour goes; not positive: not at all.
out float beyond;

// How wide it is smoothed, in parts of how far shadows of the sky reach.
const float ASIDE = 0.06;
// As crates/render/src/floor.rs has them, in parts of the extent.
const float FADES_BEHIND = 0.5;
const float FADES_WITHIN = 2.0;

// Along the horizontal direction of sight; there is no horizon without perspective, or from above.
float beyond_plant() {
    vec3 up = view[1].xyz, ahead = up * up.z - vec3(0.0, 0.0, 1.0);
    if (projection[2][3] == 0.0 || length(ahead) < 1e-3) return 0.0;
    vec4 eye = vec4(0.0, 0.0, projection[3][3], 1.0);
    ahead = normalize(ahead);
    float behind = dot((view * vec4(middle, 1.0) - eye).xyz, ahead) + FADES_BEHIND * extent;
    return (dot((view * vec4(at, 1.0) - eye).xyz, ahead) - max(behind, 0.0)) / (FADES_WITHIN * extent);
}

void main() {
    at = vec3(middle.x + around * corner.x, height, middle.z + around * corner.y);
    beyond = beyond_plant();
    open = 1.0;
#ifdef RECEIVES
    // As nothing is in the way far away, it rises to 1 at the rim.
    vec2 left = 1.0 - abs(corner);
    float rim = clamp(min(left.x, left.y) / 0.4, 0.0, 1.0);
    if (rim > 0.0) {
        // Smooth over some squares, because places of the sky are few.
        float sum = 0.0;
        for (int i = 0; i < 4; i++) {
            vec2 aside = ASIDE * around * vec2(float(i & 1) - 0.5, float(i >> 1) - 0.5);
            sum += min(open_sky(at + vec3(aside.x, 0.0, aside.y), vec3(0.0, 1.0, 0.0)), 1.0);
        }
        open = 1.0 - (1.0 - 0.25 * sum) * rim;
    }
#endif
    gl_Position = projection * view * vec4(at, 1.0);
}
