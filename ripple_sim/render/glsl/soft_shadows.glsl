// Soft shadows: percentage-closer soft shadows (PCSS), and with TRANSMISSION those of what is transparent, in colour.
#include "glsl/sampling.glsl"
#include "glsl/shadow_maps.glsl"

layout(binding = SHADOW_TEST_UNIT) uniform sampler2DShadow shadow_test;

// The pixels of a block of 2 x 2 share their search for blockers, of whose points each takes a fourth; with OWN_POINTS they
// do not. Each filters for itself: steps of two pixels would be seen.
#if OWN_POINTS
const int SHARED = 1, SEARCH_TAPS = 8;
const mat2 TURN = GOLDEN_TURN;
const float UNSEEN = 0.004;  // share of a light that nobody misses
const float NARROW = 3.0;  // radius of a penumbra, in those of `scatter`, from which what is between may be interpolated

bool in_narrow = false;  // whether a point is in a penumbra that is too narrow for that
#else
const int SHARED = 4, SEARCH_TAPS = 3;
const mat2 TURN = FOURTH_TURN;
#endif
const int FILTER_TAPS = 16;

const vec2 BY_MEANS = vec2(0.4, 0.8);  // texels of `blockers` between those: from where on they are means

// What covers the map about a point beside the receiver, over a footprint, by the point's place in the order of all.
Blockers blockers_beside(int light, Receiver at, vec2 offset, float footprint, float order)
{
    float behind = light_distance(shadow_at(light).depth, at.place.z + dot(at.slope, offset));
    Blockers seen = blockers_about(light, at.place.xy + offset, point_level(footprint, order, at.casts), behind);
    seen.share *= smoothstep(0.0, at.texel + 0.25 * footprint * at.width, seen.before);
    return seen;
}

// The following take as many rounds of their loops as are needed in place of branches: software drivers execute both sides
// of a branch. They are tested at the end, since such drivers execute a loop's body once more than a test before it lets
// pass. Each exposure has other points, which `counts.z` turns.

// How much blocks the light within a radius in the map, and that times its mean distance from the light [m].
vec2 find_blockers(int light, Receiver at, float radius)
{
    float first = SHARED > 1 ? first_point() : 0.5;
    vec2 direction = spiral_direction(first + counts.z), found = vec2(0.0);
    int taps = at.inside ? SEARCH_TAPS : 0, i = 0;
    do {
        // denser in the middle, where a near blocker must not be missed, and of no weight at the rim, where they come in
        float away = (float(i) + first / float(SHARED)) / float(SEARCH_TAPS);
        // the mean over as much as lies between the points: single texels would come and go from pixel to pixel
        float footprint = radius * sqrt(TWO_PI * away / float(SHARED * SEARCH_TAPS));
        Blockers seen = blockers_beside(light, at, radius * away * direction, footprint, away);
        found += at.inside ? (1.0 - away) * seen.share * vec2(1.0, seen.distance) : vec2(0.0);
        direction = TURN * direction;
    } while (++i < taps);
    return found;
}

// Share of the light past blockers whose penumbra has a radius in the map: means over parts of that; any number where not
// `needed`.
float light_by_means(int light, Receiver at, float penumbra, bool needed)
{
    float between = max(penumbra * MEAN_WIDTH, 1.0 / float(textureSize(blockers, 0).y));
    float disc = sqrt(max(penumbra * penumbra - between * between, 0.0));  // the means widen it to the penumbra's
    vec2 direction = spiral_direction(counts.z);
    float sum = 0.0;
    int taps = needed ? MEANS : 0, i = 0;
    do {
        vec2 offset = disc * mean_radius(i) * direction;
        sum += 1.0 - blockers_beside(light, at, offset, between, (float(i) + 0.5) / float(MEANS)).share;
        direction = CIRCLE_TURN * direction;
    } while (++i < taps);
    return sum / float(MEANS);
}

#if !OWN_POINTS
// The same by points of the map, for narrow penumbras.
float light_by_points(int light, Receiver at, float penumbra, bool needed)
{
    float sum = 0.0;
    vec2 direction = spiral_direction(0.5 + counts.z);
    int taps = needed ? FILTER_TAPS : 0, i = 0;
    do {
        vec2 offset = penumbra * sqrt((float(i) + 0.5) / float(FILTER_TAPS)) * direction;
        float depth = at.place.z + dot(at.slope, offset) - at.depth_bias;
        sum += textureLod(shadow_test, vec3(in_maps(light, at.place.xy + offset), depth), 0.0);
        direction = GOLDEN_TURN * direction;
    } while (++i < taps);
    return sum / float(FILTER_TAPS);
}
#endif

// Share of a light that arrives. The part of the pixel's block of 2 x 2 that lies to the given sides shares the search.
// The normal is that of the surface without ripples; `bias` [m] raises the position above bumps, which shall not shade
// each other, and is negative for what casts no shadow itself; `scatter` [m] is how far light gets under the surface, or
// with OWN_POINTS how far such points are apart.
float light_visibility(int light, vec3 position, vec3 normal, float bias, float scatter, bvec2 block)
{
    float facing = dot(normal, towards_light(light, position));
    Receiver at = receiver(light, position, normal, facing, bias);
    float scattered = scatter / at.width, sharpest = 1.5 / shadow_at(light).width.z;
    float least = SHARED == 1 ? sharpest : length(vec2(sharpest, scattered));
    vec2 found = find_blockers(light, at, widest_penumbra(light, at.distance) + max(least, scattered));
    found = vec2(block_mean(found.x, block), block_mean(found.y, block));
    float penumbra = length(vec2(penumbra_of(light, found.y / max(found.x, 1e-4), at.distance), least));
    bool shaded = at.inside && found.x > 1e-4;
    float texels = penumbra * MEAN_WIDTH * float(textureSize(blockers, 0).y);
#if OWN_POINTS
    // narrow ones are widened, so that none falls between
    bool narrow = penumbra < NARROW * scattered || texels < BY_MEANS.y;
    float lit = light_by_means(light, at, penumbra + (narrow ? scattered : 0.0), shaded);
#else
    float wide = smoothstep(BY_MEANS.x, BY_MEANS.y, texels);
    float by_points = light_by_points(light, at, penumbra, shaded && wide < 1.0);
    float lit = mix(by_points, light_by_means(light, at, penumbra, shaded && wide > 0.0), wide);
#endif
    lit = shaded ? lit : 1.0;
#if OWN_POINTS
    in_narrow = in_narrow || narrow && lit * (1.0 - lit) > UNSEEN;
#endif
    // beyond the terminator a surface shades itself, whatever the map says of it
    return at.casts ? lit * smoothstep(-0.2, 0.15, facing) : lit;
}

#if TRANSMISSION
// side by side like the shadow maps; rgb: share of the light that is taken; a: the mean of that times the distance from the light [m]
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
