// Soft shadows: percentage-closer soft shadows (PCSS). SHADOWS lights may cast them; their maps lie side by side.
#include "gpu/held_uniforms.glsl"
#include "glsl/disc.glsl"
#include "glsl/pixel_block.glsl"
#include "passes/light_distance.glsl"

layout(binding = SHADOW_TEST_UNIT) uniform sampler2DShadow shadow_test;
layout(binding = SHADOW_MAPS_UNIT) uniform sampler2D shadow_maps;
layout(binding = BLOCKERS_UNIT) uniform sampler2D blockers;  // see blockers_fragment.glsl

// The pixels of a block of 2 x 2 share the points of a disc, of which each takes a fourth. With OWN_POINTS they do not.
#if OWN_POINTS
const int SHARED = 1, SEARCH_TAPS = 8;
const mat2 TURN = GOLDEN_TURN, MEAN_TURN = CIRCLE_TURN;
const float UNSEEN = 0.004;  // share of a light that nobody misses

const float NARROW = 3.0;  // radius of a penumbra, in those of `scatter`, from which what is between may be interpolated

bool in_narrow = false;  // whether a point is in a penumbra that is too narrow for that
#else
const int SHARED = 4, SEARCH_TAPS = 3;
const mat2 TURN = FOURTH_TURN, MEAN_TURN = FOURTH_CIRCLE_TURN;
#endif
const int FILTER_TAPS = 64 / SHARED, MEAN_TAPS = MEANS / SHARED;

// Number, and a half, of this pixel's first point.
float own_first_point()
{
    return SHARED > 1 ? first_point() : 0.5;
}

// Place of one of a pixel's points among all, from 0 to 1.
float order_of(int tap, float first, int taps)
{
    return (float(tap) + first / float(SHARED)) / float(taps);
}

const vec2 BY_MEANS = vec2(0.4, 0.8);  // texels of `blockers` between those: from where on they are means

// Texture coordinates of a point of one light's map.
vec2 in_maps(int light, vec2 point)
{
#if SHADOWS > 1
    float edge = 0.5 / shadow_at(light).width.z;  // keeps a neighbour's texels out
    point.x = (clamp(point.x, edge, 1.0 - edge) + float(light)) / float(SHADOWS);
#endif
    return point;
}

// Radius of the penumbra, in the map, of a blocker on what lies behind it; both by their distance from the light [m].
float penumbra_of(int light, float blocker, float behind)
{
    vec4 penumbra = shadow_at(light).penumbra, width = shadow_at(light).width;
    float blur = penumbra.x + penumbra.y / max(blocker, 1e-6);
    return min((behind - blocker) * blur / (width.x + width.y * behind), penumbra.z);
}

// Radius, in the map, of what may shade a point at a distance from the light [m]: a penumbra of the nearest blocker.
float widest_penumbra(int light, float to_light)
{
    return penumbra_of(light, light_distance(shadow_at(light).depth, 0.0), to_light);
}

// Level of `blockers` whose texels are so wide a share of the map, or the finest.
float blockers_level(float footprint)
{
    return log2(max(footprint * float(textureSize(blockers, 0).y), 1.0));
}

// The same for one of the points of a disc, by its place in their order, 0 to 1. `whole` levels cost half of those between,
// of which two are read: in place of them some points take the lower and some the higher. On the floor it would be seen.
float point_level(float footprint, float order, bool whole)
{
    float level = blockers_level(footprint);
    return whole ? floor(level + order) : level;
}

// Mean of what covers a map about a point, over so much of the map: see blockers_fragment.glsl.
vec3 blockers_mean(int light, vec2 point, float footprint)
{
    return textureLod(blockers, in_maps(light, point), blockers_level(footprint)).rgb;
}

// What covers a map about a point and lies before a surface: a share of the map, its distance from the light [m], and how
// far before the surface the mean of all is [m].
struct Blockers { float share, distance, before; };

// What covers the map is in part the surface itself; the rest blocks: two distances with that mean and that variance
// (Yang et al., Variance Soft Shadow Mapping, 2010).
Blockers blockers_about(int light, vec2 point, float level, float behind)
{
    vec3 mean = textureLod(blockers, in_maps(light, point), level).rgb;
    float usual = mean.y / max(mean.x, 1e-4), variance = max(mean.z / max(mean.x, 1e-4) - usual * usual, 0.0);
    float before = max(behind - usual, 1e-6);
    return Blockers(mean.x * before * before / (before * before + variance), usual - variance / before, before);
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

// The normal is that of the surface without ripples, `facing` its cosine to the light; `bias` as for `light_visibility`.
Receiver receiver(int light, vec3 position, vec3 normal, float facing, float bias)
{
    Shadow shadow = shadow_at(light);
    vec4 source = light_at(light).position, of_depth = shadow.depth, of_width = shadow.width;
    float away = NEAR_LIGHTS == 0 || source.w == 0.0 ? 0.0 : distance(source.xyz, position);
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
    float first = own_first_point();
    vec2 direction = spiral_direction(first + counts.z), found = vec2(0.0);
    int taps = at.inside ? SEARCH_TAPS : 0, i = 0;
    do {
        // denser in the middle, where a near blocker must not be missed, and of no weight at the rim, where they come in
        float away = order_of(i, first, SEARCH_TAPS);
        // the mean over as much as lies between the points: single texels would come and go from pixel to pixel
        float footprint = radius * sqrt(TWO_PI * away / float(SHARED * SEARCH_TAPS));
        Blockers seen = blockers_beside(light, at, radius * away * direction, footprint, away);
        found += at.inside ? (1.0 - away) * seen.share * vec2(1.0, seen.distance) : vec2(0.0);
        direction = TURN * direction;
    } while (++i < taps);
    return found;
}

// Share of the light past blockers whose penumbra has a radius in the map: means over parts of that; or 1 where not `needed`.
float light_by_means(int light, Receiver at, float penumbra, bool needed)
{
    float between = max(penumbra * MEAN_WIDTH, 1.0 / float(textureSize(blockers, 0).y));
    float disc = sqrt(max(penumbra * penumbra - between * between, 0.0));  // the means widen it to the penumbra's
    float first = own_first_point(), turned = CIRCLE_ANGLE * (first - 0.5) + GOLDEN_ANGLE * counts.z, sum = 0.0;
    vec2 direction = vec2(cos(turned), sin(turned));
    int taps = needed ? MEAN_TAPS : 0, i = 0;
    do {
        float away = float(i) + first < 1.0 ? 0.0 : CIRCLE_RADIUS;
        sum += 1.0 - blockers_beside(light, at, disc * away * direction, between, order_of(i, first, MEAN_TAPS)).share;
        direction = MEAN_TURN * direction;
    } while (++i < taps);
    return sum / float(MEAN_TAPS);
}

#if !OWN_POINTS
// The same by points of the map, for narrow penumbras.
float light_by_points(int light, Receiver at, float penumbra, bool needed)
{
    float first = own_first_point(), sum = 0.0;
    vec2 direction = spiral_direction(first + counts.z);
    int taps = needed ? FILTER_TAPS : 0, i = 0;
    do {
        vec2 offset = penumbra * sqrt(order_of(i, first, FILTER_TAPS)) * direction;
        float depth = at.place.z + dot(at.slope, offset) - at.depth_bias;
        sum += textureLod(shadow_test, vec3(in_maps(light, at.place.xy + offset), depth), 0.0);
        direction = TURN * direction;
    } while (++i < taps);
    return sum / float(FILTER_TAPS);
}
#endif

// Share of a light that arrives, as the mean over the part of the pixel's block of 2 x 2 that lies to the given sides.
// The normal is that of the surface without ripples; `bias` [m] raises the position above bumps, which shall not shade
// each other, and is negative for what casts no shadow itself; `scatter` [m] is how far light gets under the surface, or
// with OWN_POINTS how far such points are apart.
float light_visibility(int light, vec3 position, vec3 normal, float bias, float scatter, bvec2 block)
{
    Light from = light_at(light);
    bool far_away = NEAR_LIGHTS == 0 || from.position.w == 0.0;
    float facing = dot(normal, far_away ? from.direction.xyz : normalize(from.position.xyz - position));
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
    lit = block_mean(shaded ? lit : 1.0, block);
#if OWN_POINTS
    in_narrow = in_narrow || narrow && lit * (1.0 - lit) > UNSEEN;
#endif
    // beyond the terminator a surface shades itself, whatever the map says of it
    return at.casts ? lit * smoothstep(-0.2, 0.15, facing) : lit;
}
