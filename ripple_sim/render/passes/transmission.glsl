// Shadows of what is transparent, in colour; with TRANSMISSION, otherwise there are none. Their maps lie side by side.
#include "passes/shadow.glsl"

#if TRANSMISSION
// rgb: share of the light that is taken; a: the mean of that times the distance from the light [m]
layout(binding = TRANSMISSION_UNIT) uniform sampler2D transmission_maps;

const float CLOSEST = 3.0;  // distance at which things begin to shade one another, in texels [m]

// Mean of what is taken about a point of a light's map, as far as a radius, both in the map.
vec4 taken_about(int light, vec2 point, float radius)
{
    float level = log2(max(2.0 * radius * float(textureSize(transmission_maps, 0).y), 1.0));
    return textureLod(transmission_maps, in_maps(light, point), level);
}

// Mean share of the light that is taken, and that times its distance from the light [m].
vec2 transparent_blocker(vec4 taken)
{
    return vec2(dot(taken.rgb, vec3(1.0 / 3.0)), taken.a);
}

// Share of a light that passes all that is transparent on its way to a point; the rest as for `light_visibility`.
vec3 transmitted(int light, vec3 position, vec3 normal, float scatter)
{
    Shadow shadow = shadow_at(light);
    vec4 clip = shadow.matrix * vec4(position, 1.0);
    vec3 p = clip.xyz / clip.w;
    float to_light = light_distance(shadow.depth, p.z);
    float slope = 1.0 / max(abs(dot(normal, towards_light(light, position))), 0.1);
    float width = shadow.width.x + shadow.width.y * to_light, texel = width / float(textureSize(transmission_maps, 0).y);
    bool inside = counts.w > float(light) && clip.w > 0.0 && all(lessThan(abs(p - 0.5), vec3(0.5)));
    vec2 found = transparent_blocker(taken_about(light, p.xy, 0.5 * widest_penumbra(light, to_light)));
    float penumbra = penumbra_of(light, min(found.y / max(found.x, 1e-4), to_light), to_light);
    vec3 taken = vec3(0.0);
    float disc = penumbra * sqrt(1.0 - MEAN_WIDTH * MEAN_WIDTH);  // as in light_by_means
    vec2 direction = spiral_direction(counts.z);
    int taps = inside && found.x > 0.0 ? MEANS : 0;
    for (int i = 0; i < taps; ++i) {
        vec2 offset = disc * mean_radius(i) * direction;
        direction = CIRCLE_TURN * direction;
        vec4 here = taken_about(light, p.xy + offset, 0.5 * MEAN_WIDTH * penumbra);
        vec2 blocker = transparent_blocker(here);
        float before = to_light - blocker.y / max(blocker.x, 1e-4);
        taken += here.rgb * smoothstep(1.0, CLOSEST, before / (slope * texel));
    }
    taken /= float(MEANS);
#if OWN_POINTS
    in_narrow = in_narrow || penumbra < NARROW * scatter / width && any(greaterThan(taken, vec3(UNSEEN)));
#endif
    return 1.0 - taken;
}
#else
vec3 transmitted(int light, vec3 position, vec3 normal, float scatter)
{
    return vec3(1.0);
}
#endif

// Share of a light that arrives, through what is transparent and past all else; see `light_visibility`.
vec3 light_arriving(int light, vec3 position, vec3 normal, float bias, float scatter, bvec2 block)
{
    return light_visibility(light, position, normal, bias, scatter, block) *
           transmitted(light, position, normal, scatter);
}
