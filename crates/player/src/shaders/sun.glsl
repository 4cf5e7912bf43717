// The part of the sun's light that comes to a place past what is nearer to the sun.

#ifdef RECEIVES
uniform highp sampler2DShadow sun_map;
// Towards the sun, in the directions of the scene; 0 if there is none.
uniform vec3 sun_from;

// Smooth over three by three cells.
float sunlit(vec3 at, vec3 normal) {
    float cells = float(textureSize(sun_map, 0).x);
    vec3 place = looked_up(at, normal, sun_from, cells);
    if (!is_within(place.xy, 2.0 / cells)) return 1.0;
    float sum = 0.0;
    for (int i = 0; i < 9; i++) {
        vec2 aside = vec2(float(i % 3 - 1), float(i / 3 - 1)) / cells;
        sum += texture(sun_map, vec3(place.xy + aside, place.z));
    }
    return sum / 9.0;
}
#endif
