// The rigid floor: of a colour of its own under a declared sky, else as light as the background and darker in shadow.
// Host: version, precision, shade.glsl and sun.glsl stand before this.

in vec3 at;
in float open;
in float beyond;

// The colour under a declared sky; its first number is negative without one.
uniform vec3 earth;
// As for surfaces.
uniform vec3 tint;
uniform float relief;
uniform float extent;

out vec4 painted;

// How much darker the floor is where no sky is seen, without declared light; and around the plant.
const float CONTACT = 0.5;
const float POOL = 0.06;
const float POOL_REACH = 1.2;

void main() {
    vec2 away = (at.xz - middle.xz) / (POOL_REACH * extent);
    float strength = 1.0 - CONTACT * (1.0 - open);
    if (tint.r >= 0.0) {
        float sky = SKY_ALONE, sun = 0.0, past = 1.0;
#ifdef RECEIVES
        if (dot(sun_from, sun_from) > 0.0) {
            sky = SKY;
            sun = SUN * max(sun_from.y, 0.0);
            if (sun > 0.0) past = sunlit(at, vec3(0.0, 1.0, 0.0));
        }
#endif
        strength = (sky * thrown(open) + LEAST + sun * past) / (sky + LEAST + sun);
    }
    strength = (1.0 - POOL * exp(-dot(away, away))) * min(strength, 1.0);
    // As the drawing gains depth.
    strength = 1.0 + relief * (strength - 1.0);
    // A floor of a colour fades into the horizon.
    float away_by = max(beyond, 0.0), left = 1.0 / (1.0 + away_by * away_by);
    painted = earth.r >= 0.0 ? vec4(lit(earth, strength, tint), 1.0) * left : vec4(lit(vec3(1.0), 0.0, vec3(-1.0)), 1.0) * (1.0 - strength);
}
