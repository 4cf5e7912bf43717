// The light of pictures (export/light.rs): one lamp, fixed to the viewer; a gloss; things get darker with their distance.

in vec3 seen;
in vec3 facing;
in vec3 shade;

// How much relief is drawn, from 0 (a flat drawing) to 1.
uniform float relief;
// Light that is lost for a unit of depth, and the depth from which.
uniform float falloff;
uniform float near;

out vec4 painted;

const vec3 LAMP = vec3(-0.36, 0.583, 0.728361861);
const float DIFFUSE = 0.52;
const float GLOSS = 0.16;
const float SHARPNESS = 24.0;

void main() {
    vec3 normal = normalize(facing);
    // Of what is seen from behind, the back is lit.
    if (!gl_FrontFacing) normal = -normal;
    vec3 half_way = normalize(LAMP + vec3(0.0, 0.0, 1.0));
    float gloss = pow(max(dot(normal, half_way), 0.0), SHARPNESS) - pow(half_way.z, SHARPNESS);
    float strength = 1.0 - falloff * max(near - seen.z, 0.0)
        + relief * (DIFFUSE * (max(dot(normal, LAMP), 0.0) - LAMP.z) + GLOSS * gloss);
    vec3 shadow = vec3(0.0, 0.05, 0.15);
    vec3 lit = strength <= 1.0
        ? shade * (shadow + (1.0 - shadow) * strength)
        : shade + (1.0 - shade) * (strength - 1.0);
    painted = vec4(clamp(lit, 0.0, 1.0), 1.0);
}
