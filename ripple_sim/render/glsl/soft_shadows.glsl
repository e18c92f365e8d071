// The shadow maps of the lights, and soft shadows: percentage-closer soft shadows (PCSS), and with TRANSMISSION the coloured
// shadows of transparent objects. SHADOWS lights may cast shadows; their maps lie side by side.
#include "glsl/held_uniforms.glsl"
#include "glsl/sampling.glsl"

layout(binding = SHADOW_MAPS_UNIT) uniform sampler2D shadow_maps;
layout(binding = BLOCKERS_UNIT) uniform sampler2D blockers;  // see blockers.glsl

// Texture coordinates of a point of one light's map.
vec2 in_maps(int light, vec2 point)
{
#if SHADOWS > 1
    float edge = 0.5 / shadow_at(light).width.z;  // keeps a neighbour's texels out
    point.x = (clamp(point.x, edge, 1.0 - edge) + float(light)) / float(SHADOWS);
#endif
    return point;
}

// Radius of the penumbra, in the map, of a blocker on a surface behind it; both by their distance from the light [m].
float penumbra_of(int light, float blocker, float behind)
{
    vec4 penumbra = shadow_at(light).penumbra, width = shadow_at(light).width;
    float blur = penumbra.x + penumbra.y / max(blocker, 1e-6);
    return min((behind - blocker) * blur / (width.x + width.y * behind), penumbra.z);
}

// Radius, in the map, in which blockers may shade a point at a distance from the light [m]: the penumbra of the nearest.
float widest_penumbra(int light, float to_light)
{
    return penumbra_of(light, light_distance(shadow_at(light).depth, 0.0), to_light);
}

bool is_far(int light)
{
    return NEAR_LIGHTS == 0 || light_at(light).position.w == 0.0;
}

vec3 towards_light(int light, vec3 position)
{
    Light from = light_at(light);
    return is_far(light) ? from.direction.xyz : normalize(from.position.xyz - position);
}

// A point of a surface, as a light sees it.
struct Receiver {
    vec3 place;             // in the light's map, and the depth there
    vec2 slope;             // of the surface's depth along the map
    float distance;         // from the light [m]
    float width, texel;     // of the map and of one of its texels, at that distance [m]
    float depth_bias;
    bool inside;            // whether the map reaches as far
    bool casts;             // whether the surface casts shadows itself
};

// `normal` is without ripples, `facing` its cosine to the light; `bias` is as for `light_visibility`.
Receiver receiver(int light, vec3 position, vec3 normal, float facing, float bias)
{
    Shadow shadow = shadow_at(light);
    vec4 of_depth = shadow.depth, of_width = shadow.width;
    float away = is_far(light) ? 0.0 : distance(light_at(light).position.xyz, position);
    Receiver at;
    at.casts = bias >= 0.0;
    at.texel = (of_width.x + of_width.y * away) / of_width.z;
    vec3 raised = position + (at.casts ? bias + (1.0 + 1.5 * (1.0 - facing)) * at.texel : 0.0) * normal;
    vec4 clip = shadow.matrix * vec4(raised, 1.0);
    at.place = clip.xyz / clip.w;
    at.distance = light_distance(of_depth, at.place.z);
    at.width = of_width.x + of_width.y * at.distance;
    float stretch = of_depth.z * at.place.z + of_depth.w;
    float metre = stretch * stretch / (of_depth.x * of_depth.w - of_depth.y * of_depth.z);
    // receiver plane depth bias: with a wide filter the surface would shade itself
    vec4 plane = shadow.planes * vec4(normal, -dot(normal, raised));
    float steepest = 10.0 * at.width * metre;
    vec2 slope = -plane.xy * (abs(plane.z) > 1e-9 ? 1.0 / plane.z : 1e9);
    at.slope = clamp(slope, -steepest, steepest);
    at.depth_bias = 0.5 * at.texel * metre;
    bool in_map = clip.w > 0.0 && all(lessThan(abs(at.place - 0.5), vec3(0.5)));
    at.inside = counts.w > float(light) && facing > -0.2 && in_map;
    return at;
}

// Level of `blockers` whose texels have a width, as a share of the map, or the finest level.
float blockers_level(float footprint)
{
    return log2(max(footprint * float(textureSize(blockers, 0).y), 1.0));
}

// Mean of the blockers about a point of a map, over a share of the map: see blockers.glsl.
vec3 blockers_mean(int light, vec2 point, float footprint)
{
    return textureLod(blockers, in_maps(light, point), blockers_level(footprint)).rgb;
}

layout(binding = SHADOW_TEST_UNIT) uniform sampler2DShadow shadow_test;

// The pixels of a block of 2 x 2 share their search for blockers: each takes a fourth of the points. With OWN_POINTS they do
// not. Each pixel filters for itself: steps of two pixels would be visible.
#if OWN_POINTS
const int SHARED = 1, SEARCH_TAPS = 8;
const mat2 TURN = GOLDEN_TURN;
const float UNSEEN = 0.004;  // share of a light that is not noticed
const float NARROW = 3.0;  // radius of a penumbra, over the radius of `scatter`, from which values between may be interpolated

bool in_narrow = false;  // whether a point is in a penumbra that is too narrow to be interpolated
#else
const int SHARED = 4, SEARCH_TAPS = 3;
const mat2 TURN = FOURTH_TURN;
#endif
const int FILTER_TAPS = 16;

const vec2 BY_MEANS = vec2(0.4, 0.8);  // texels of `blockers` between those: from where on they are means

// Blockers about a point of a map, before a surface: their share of the map, and their distance from the light [m].
struct Blockers { float share, distance; };

// Of a point beside the receiver, over a footprint, by the point's place in the order of all. What covers the map is in part
// the surface itself; the rest blocks: two distances with that mean and that variance (Yang et al., Variance Soft Shadow
// Mapping, 2010).
Blockers blockers_beside(int light, Receiver at, vec2 offset, float footprint, float order)
{
    float behind = light_distance(shadow_at(light).depth, at.place.z + dot(at.slope, offset));
    // whole levels cost half of those between, of which two are read: in place of them some points take the lower and some
    // the higher. On the floor it would be seen.
    float level = blockers_level(footprint);
    vec3 mean = textureLod(blockers, in_maps(light, at.place.xy + offset), at.casts ? floor(level + order) : level).rgb;
    float usual = mean.y / max(mean.x, 1e-4), variance = max(mean.z / max(mean.x, 1e-4) - usual * usual, 0.0);
    float before = max(behind - usual, 1e-6), share = mean.x * before * before / (before * before + variance);
    return Blockers(share * smoothstep(0.0, at.texel + 0.25 * footprint * at.width, before), usual - variance / before);
}

// The following take as many rounds of their loops as are needed in place of branches: software drivers execute both sides
// of a branch. They are tested at the end, since such drivers execute a loop's body once more than a test before it lets
// pass. Each exposure has other points, which `counts.z` turns.

// Share of blockers within a radius in the map, and the share times their mean distance from the light [m].
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
    // beyond the terminator a surface shades itself, also where the map says otherwise
    return at.casts ? lit * smoothstep(-0.2, 0.15, facing) : lit;
}

#if TRANSMISSION
// side by side like the shadow maps; rgb: share of the light that is taken; a: the mean of that times the distance from the light [m]
layout(binding = TRANSMISSION_UNIT) uniform sampler2D transmission_maps;

const float CLOSEST = 3.0;  // distance at which things begin to shade one another, in texels [m]

// Mean light that is taken about a point of a light's map, within a radius, both in the map.
vec4 taken_about(int light, vec2 point, float radius)
{
    float level = log2(max(2.0 * radius * float(textureSize(transmission_maps, 0).y), 1.0));
    return textureLod(transmission_maps, in_maps(light, point), level);
}

// Mean share of the light that is taken, and the share times its distance from the light [m].
vec2 transparent_blocker(vec4 taken)
{
    return vec2(dot(taken.rgb, vec3(1.0 / 3.0)), taken.a);
}
#endif

// Share of a light that passes the transparent objects on its way to a point; arguments as for `light_visibility`.
vec3 transmitted(int light, vec3 position, vec3 normal, float scatter)
{
    vec3 taken = vec3(0.0);
#if TRANSMISSION
    Shadow shadow = shadow_at(light);
    vec4 clip = shadow.matrix * vec4(position, 1.0);
    vec3 p = clip.xyz / clip.w;
    float to_light = light_distance(shadow.depth, p.z);
    float slope = 1.0 / max(abs(dot(normal, towards_light(light, position))), 0.1);
    float width = shadow.width.x + shadow.width.y * to_light, texel = width / float(textureSize(transmission_maps, 0).y);
    bool inside = counts.w > float(light) && clip.w > 0.0 && all(lessThan(abs(p - 0.5), vec3(0.5)));
    vec2 found = transparent_blocker(taken_about(light, p.xy, 0.5 * widest_penumbra(light, to_light)));
    float penumbra = penumbra_of(light, min(found.y / max(found.x, 1e-4), to_light), to_light);
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
#endif
    return 1.0 - taken;
}

// Share of a light that arrives through transparent objects and past opaque ones; see `light_visibility`.
vec3 light_arriving(int light, vec3 position, vec3 normal, float bias, float scatter, bvec2 block)
{
    return light_visibility(light, position, normal, bias, scatter, block) *
           transmitted(light, position, normal, scatter);
}
