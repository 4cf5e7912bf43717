// A corner of a triangle as a light shows it, for maps of what is nearest to that. Host: version, precision and shade.glsl stand before this.

in vec3 corner;

uniform vec3 light;

#ifdef PICTURES
in vec3 pin;
out vec2 place;
flat out float picture;
#endif

void main() {
#ifdef PICTURES
    place = pin.xy;
    picture = pin.z;
#endif
    gl_Position = vec4(mapped(corner, axes_of(light)), 1.0);
}
