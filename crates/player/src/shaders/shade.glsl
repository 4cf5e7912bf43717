// What the light of surfaces and that of the floor have in common (crates/render/src/lighting.rs and shadow.rs): strengths of declared light,
// shadows, and how a colour looks in light of a strength.

const float SKY = 0.56;
const float SKY_ALONE = 1.25;
const float SUN = 0.66;
const float GROUND = 0.26;
const float LEAST = 0.04;
const float TINTED = 0.5;

// The strength of the sky's light at a place from which this part of the sky is seen.
float thrown(float part) {
    if (part >= 1.0) return part;
    float light = max(max(part, ((0.688 * part - 1.756) * part + 2.068) * part), 0.0);
    return part + (sqrt(light) - part) * (1.0 - part) * (1.0 - part);
}

// The ball whose insides cast shadows, and how deep the maps are, in scene units.
uniform vec3 middle;
uniform float reach;
uniform float depths;

// Axes of a map: to the right, up and towards the light.
mat3 axes_of(vec3 light) {
    vec3 aside = abs(light.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(0.0, 0.0, 1.0);
    vec3 right = normalize(cross(aside, light));
    return mat3(right, cross(light, right), light);
}

// A place in the map of a light, each number from -1 to 1, the last one away from the light.
vec3 mapped(vec3 at, mat3 axes) {
    vec3 place = (at - middle) * axes;
    return vec3(place.xy / reach, -place.z / depths);
}

#ifdef RECEIVES
// Bias of depths, in cells: on a surface that faces the light, and at most.
const float BIAS = 1.0;
const float STEEPEST = 8.0;

// Where a place on a surface is looked up in a map with so many cells to a side, each number from 0 to 1: off the surface by a cell, and
// nearer to the light.
vec3 looked_up(vec3 at, vec3 normal, vec3 light, float cells) {
    float cell = 2.0 * reach / cells;
    float cosine = clamp(dot(normal, light), 0.05, 1.0);
    float slope = sqrt(1.0 - cosine * cosine) / cosine;
    vec3 place = mapped(at + normal * cell, axes_of(light));
    place.z -= min(BIAS * (1.0 + slope), STEEPEST) * cell / depths;
    // Nothing is farther from the light than all that a map holds.
    return min(0.5 * place + 0.5, 1.0);
}

bool is_within(vec2 place, float rim) {
    return all(greaterThan(place, vec2(rim))) && all(lessThan(place, vec2(1.0 - rim)));
}
#endif

// A colour in light of this strength; `tint` is that of a declared sky, its first number negative without one.
vec3 lit(vec3 color, float strength, vec3 tint) {
    if (tint.r >= 0.0) color *= mix(vec3(1.0), tint, TINTED * (1.0 - clamp((strength - 0.35) / 0.5, 0.0, 1.0)));
    vec3 shadow = vec3(0.0, 0.05, 0.15);
    vec3 seen = strength <= 1.0
        ? color * (shadow + (1.0 - shadow) * strength)
        : color + (1.0 - color) * (strength - 1.0);
    return clamp(seen, 0.0, 1.0);
}
