// The light of the sky, past what is nearer to it: the mean over places of the sky, each with a map of its own.

#ifdef RECEIVES
uniform highp sampler2DArrayShadow sky_maps;
uniform vec3 sky_from[PLACES];
// Whether there are maps; else nothing is in the way.
uniform bool has_sky;

// On the side of a surface with this normal: 1 on the open ground.
float open_sky(vec3 at, vec3 normal) {
    if (!has_sky) return 0.5 + 0.5 * normal.y;
    float cells = float(textureSize(sky_maps, 0).x), sum = 0.0;
    for (int i = 0; i < PLACES; i++) {
        float cosine = dot(normal, sky_from[i]);
        if (cosine <= 0.0) continue;
        vec3 place = looked_up(at, normal, sky_from[i], cells);
        sum += cosine * (is_within(place.xy, 1.0 / cells) ? texture(sky_maps, vec4(place.xy, float(i), place.z)) : 1.0);
    }
    // The mean cosine over the places is a half.
    return 2.0 * sum / float(PLACES);
}

// The same, and what of it comes from one surface to the next.
float open_side(vec3 at, vec3 normal) {
    float free = max(0.5 + 0.5 * normal.y, 1e-3);
    return free * thrown(open_sky(at, normal) / free);
}
#endif
