// The light of pictures (crates/render/src/light.rs): one lamp, fixed to the viewer; light from all directions, more of it from above; light
// that comes through leaves; a gloss; things get darker with their distance. Or a declared sun and sky, with shadows.
// Host: version, precision, shade.glsl and sun.glsl stand before this.

in vec3 seen;
in vec3 facing;
in vec4 shade;
in vec2 open;

uniform mat4 view;
// How much relief is drawn, from 0 (a flat drawing) to 1.
uniform float relief;
// Light that is lost for a unit of depth, and the depth from which.
uniform float falloff;
uniform float near;
// Towards the declared sun, to the right, up and towards the viewer; 0 if there is none.
uniform vec3 sun;
// Up, in the same directions.
uniform vec3 zenith;
// Tint of the light of a declared sky; its first number is negative if there is neither sun nor sky.
uniform vec3 tint;

#ifdef PICTURES
in vec2 place;
flat in float picture;
// Colours times opacity.
uniform sampler2DArray pictures;
// Whether samples of a pixel count by opacity.
uniform float smooth_edges;
#endif

out vec4 painted;

const vec3 LAMP = vec3(-0.36, 0.583, 0.728361861);
const float DIFFUSE = 0.48;
const float WRAP = 0.25;
const float TRANSMITTED = 0.55;
const float ABOVE = 0.08;
const float GLOSS = 0.16;
const float SHARPNESS = 24.0;

void main() {
    vec3 normal = normalize(facing);
    // Of what is seen from behind, the back is lit.
    if (!gl_FrontFacing) normal = -normal;
    vec3 color = shade.rgb;
    float through = TRANSMITTED * shade.a;
    float opacity = 1.0;
#ifdef PICTURES
    // Derivatives are those of all pixels, before any of them goes another way.
    vec2 down = vec2(place.x, 1.0 - place.y);
    vec2 right_by = dFdx(down), up_by = dFdy(down);
    if (picture >= 0.0) {
        int number = int(picture + 0.5);
        vec2 at = (number & 1) == 1 ? fract(down) : down;
        vec4 texel = textureGrad(pictures, vec3(at, float(number >> 1)), right_by, up_by);
        color = texel.rgb / max(texel.a, 1.0 / 255.0);
        opacity = texel.a;
    }
    float slope = fwidth(opacity);
    opacity = clamp((opacity - 0.5) / max(slope, 1e-3) + 0.5, 0.0, 1.0);
    if (smooth_edges < 0.5) opacity = step(0.5, opacity);
    if (opacity <= 0.0) discard;
#endif
    float strength;
    if (tint.r < 0.0) {
        vec3 half_way = normalize(LAMP + vec3(0.0, 0.0, 1.0));
        float gloss = pow(max(dot(normal, half_way), 0.0), SHARPNESS) - pow(half_way.z, SHARPNESS);
        float cosine = dot(normal, LAMP);
        float here = DIFFUSE * (max(cosine + WRAP, 0.0) - (LAMP.z + WRAP)) / (1.0 + WRAP) + ABOVE * normal.y;
        float behind = DIFFUSE * (max(WRAP - cosine, 0.0) - (LAMP.z + WRAP)) / (1.0 + WRAP) - ABOVE * normal.y;
        // Ground goes on behind the plant.
        strength = 1.0 - min(falloff * max(near - seen.z, 0.0), 0.25) + relief * (here + through * max(behind - here, 0.0) + GLOSS * gloss);
    } else {
        bool has_sun = dot(sun, sun) > 0.0;
        vec2 sky = gl_FrontFacing ? open : open.yx;
        float from_sky = sky.x + through * max(sky.y - sky.x, 0.0);
        float strong = (has_sun ? SKY : SKY_ALONE) * from_sky + GROUND * (0.5 - 0.5 * dot(normal, zenith)) + LEAST;
        float cosine = dot(normal, sun);
        if (has_sun && (cosine > 0.0 || through > 0.0)) {
            vec3 half_way = normalize(sun + vec3(0.0, 0.0, 1.0));
            float gloss = cosine > 0.0 ? GLOSS * pow(max(dot(normal, half_way), 0.0), SHARPNESS) : 0.0;
            float past = 1.0;
#ifdef RECEIVES
            vec3 lit_side = cosine < 0.0 ? -normal : normal;
            past = sunlit((seen - view[3].xyz) * mat3(view), lit_side * mat3(view));
#endif
            strong += past * (SUN * (cosine > 0.0 ? cosine : -through * cosine) + gloss);
        }
        strength = 1.0 + relief * (strong - 1.0);
    }
    painted = vec4(lit(color, strength, tint), opacity);
}
