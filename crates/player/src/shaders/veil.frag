// A blob of gas in front of what is behind it: its light, and the part of the light from behind that it stops.

in vec2 aside;
flat in vec2 thick;
flat in vec3 shade;

out vec4 painted;

void main() {
    float stopped = thick.y * (1.0 - exp(-thick.x * exp(-0.5 * dot(aside, aside))));
    painted = vec4(shade * stopped, stopped);
}
