// A place of the rigid floor. Host: version, precision, shade.glsl and open.glsl stand before this.

// From the middle, in parts of how far shadows of the sky reach; those outermost are as far as the floor is seen.
in vec2 corner;

uniform mat4 view;
uniform mat4 projection;
uniform float height;
uniform float around;

out vec3 at;
// The part of the sky that is seen.
out float open;

// How wide it is smoothed, in parts of how far shadows of the sky reach.
const float ASIDE = 0.06;

void main() {
    at = vec3(middle.x + around * corner.x, height, middle.z + around * corner.y);
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
