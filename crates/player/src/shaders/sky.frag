// The declared sky (crates/render/src/sky.rs): in perspective by the elevation of what is seen, else from the lower edge to the upper one.

in float row;

uniform vec3 high;
uniform vec3 low;
// Up, in the directions of the view.
uniform vec3 zenith;
// Half of the height that is seen at the distance 1; 0 without perspective.
uniform float slope;

out vec4 painted;

const float ZENITH = 0.75;
const float HAZE = 0.7;

void main() {
    float sine = dot(normalize(vec3(0.0, row * slope, -1.0)), zenith);
    float up = slope > 0.0 ? pow(clamp(sine / ZENITH, 0.0, 1.0), HAZE) : 0.5 + 0.5 * row;
    painted = vec4(mix(low, high, up), 1.0);
}
