// What is cut out of a picture casts no shadow.

#ifdef PICTURES
in vec2 place;
flat in float picture;
uniform sampler2DArray pictures;
#endif

void main() {
#ifdef PICTURES
    if (picture >= 0.0) {
        int number = int(picture + 0.5);
        vec2 down = vec2(place.x, 1.0 - place.y);
        vec2 at = (number & 1) == 1 ? fract(down) : down;
        if (textureLod(pictures, vec3(at, float(number >> 1)), 0.0).a < 0.5) discard;
    }
#endif
}
