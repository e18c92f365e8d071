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
const int SHARED = 1;
const mat2 TURN = GOLDEN_TURN, MEAN_TURN = RING_TURN;
const float UNSEEN = 0.004;  // share of a light that nobody misses

const float NARROW = 6.0;  // radius of a penumbra, in those of `scatter`, from which what is between may be interpolated

bool in_narrow = false;  // whether a point is in a penumbra that is too narrow for that; those of transparent things are not
#else
const int SHARED = 4;
const mat2 TURN = FOURTH_TURN, MEAN_TURN = FOURTH_RING_TURN;
#endif
const int SEARCH_TAPS = 16 / SHARED, FILTER_TAPS = 64 / SHARED, MEAN_TAPS = MEANS / SHARED;

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

// Share of a light that arrives, as the mean over the part of the pixel's block of 2 x 2 that lies to the given sides.
// The normal is that of the surface without ripples; `bias` [m] raises the position above bumps, which shall not shade
// each other, and is negative for what casts no shadow itself; `scatter` [m] is how far light gets under the surface.
float light_visibility(int light, vec3 position, vec3 normal, float bias, float scatter, bvec2 block)
{
    Light from = light_at(light);
    Shadow shadow = shadow_at(light);
    vec4 place = from.position, of_depth = shadow.depth, of_width = shadow.width;
    bool far_away = NEAR_LIGHTS == 0 || place.w == 0.0;
    vec3 towards = far_away ? from.direction.xyz : normalize(place.xyz - position);
    float facing = dot(normal, towards);
    float away = far_away ? 0.0 : distance(place.xyz, position);
    float texel = (of_width.x + of_width.y * away) / of_width.z;
    float raise = bias < 0.0 ? 0.0 : bias + (1.0 + 1.5 * (1.0 - facing)) * texel;
    vec3 raised = position + raise * normal;
    vec4 clip = shadow.matrix * vec4(raised, 1.0);
    vec3 p = clip.xyz / clip.w;
    float to_light = light_distance(of_depth, p.z), width = of_width.x + of_width.y * to_light;
    float stretch = of_depth.z * p.z + of_depth.w;
    float metre = stretch * stretch / (of_depth.x * of_depth.w - of_depth.y * of_depth.z);
    // receiver plane depth bias: with a wide filter the surface would shade itself
    vec4 plane = shadow.planes * vec4(normal, -dot(normal, raised));
    float steepest = 10.0 * width * metre;
    vec2 slope = -plane.xy * (abs(plane.z) > 1e-9 ? 1.0 / plane.z : 1e9);
    slope = clamp(slope, -steepest, steepest);
    float first = own_first_point();
    vec2 start = spiral_direction(first + counts.z), direction = start;  // another one in each exposure
    float depth_bias = 0.5 * texel * metre;
    float least = SHARED > 1 ? length(vec2(1.5 / of_width.z, scatter / width)) : 1.5 / of_width.z;
    float widest = widest_penumbra(light, to_light) + max(least, scatter / width);

    // Loops of as many rounds as are needed in place of branches: software drivers execute both sides of a branch. They
    // are tested at the end, since such drivers execute a loop's body once more than a test before it lets pass.
    bool inside = counts.w > float(light) && facing > -0.5 && clip.w > 0.0 && all(lessThan(abs(p - 0.5), vec3(0.5)));
    bool whole = bias >= 0.0;
    float distances = 0.0, found = 0.0;
    int taps = inside ? SEARCH_TAPS : 0, i = 0;
    do {
        // denser in the middle, where a near blocker must not be missed, and of no weight at the rim, where they come in
        float away = order_of(i, first, SEARCH_TAPS);
        vec2 offset = widest * away * direction;
        direction = TURN * direction;
        // the mean over as much as lies between the points: single texels would come and go from pixel to pixel
        float footprint = widest * sqrt(TWO_PI * away / float(SHARED * SEARCH_TAPS));
        float behind = light_distance(of_depth, p.z + dot(slope, offset));
        Blockers seen = blockers_about(light, p.xy + offset, point_level(footprint, away, whole), behind);
        float blocks = (1.0 - away) * seen.share * smoothstep(0.0, texel + 0.25 * footprint * width, seen.before);
        distances += inside ? blocks * seen.distance : 0.0;
        found += inside ? blocks : 0.0;
    } while (++i < taps);
    distances = block_mean(distances, block);
    found = block_mean(found, block);
    float blocker = distances / max(found, 1e-4);
    float penumbra = length(vec2(penumbra_of(light, blocker, to_light), least));
    float side = float(textureSize(blockers, 0).y);
#if OWN_POINTS
    bool narrow = penumbra < max(NARROW * scatter / width, BY_MEANS.y / (MEAN_WIDTH * side));
    penumbra += narrow ? scatter / width : 0.0;  // so that none falls between
#endif
    // where points would be seen as steps, means over what lies between them
    float between = penumbra * MEAN_WIDTH, wide = smoothstep(BY_MEANS.x, BY_MEANS.y, between * side);
#if OWN_POINTS
    wide = 1.0;  // a single point would move the edges of shadows
#endif
    between = max(between, 1.0 / side);
    float disc = sqrt(max(penumbra * penumbra - between * between, 0.0));  // the means widen it to the penumbra's
    float of_means = 0.0, of_points = 0.0;
    bool shaded = inside && found > 1e-4;
    taps = shaded && wide > 0.0 ? MEAN_TAPS : 0;
    float turned = RING_ANGLE * (first - 0.5) + GOLDEN_ANGLE * counts.z;
    direction = vec2(cos(turned), sin(turned));
    i = 0;
    do {
        float away = float(i) + first < 1.0 ? 0.0 : RING_RADIUS;
        vec2 offset = disc * away * direction;
        direction = MEAN_TURN * direction;
        float behind = light_distance(of_depth, p.z + dot(slope, offset));
        Blockers seen = blockers_about(light, p.xy + offset, point_level(between, order_of(i, first, MEAN_TAPS), whole), behind);
        of_means += 1.0 - seen.share * smoothstep(0.0, texel + 0.25 * between * width, seen.before);
    } while (++i < taps);
    taps = shaded && wide < 1.0 ? FILTER_TAPS : 0;
    direction = start;
    i = 0;
    do {
        vec2 offset = penumbra * sqrt(order_of(i, first, FILTER_TAPS)) * direction;
        direction = TURN * direction;
        vec3 point = vec3(in_maps(light, p.xy + offset), p.z + dot(slope, offset) - depth_bias);
        of_points += textureLod(shadow_test, point, 0.0);
    } while (++i < taps);
    float lit = mix(of_points / float(FILTER_TAPS), of_means / float(MEAN_TAPS), wide);
    lit = block_mean(shaded ? lit : 1.0, block);
#if OWN_POINTS
    in_narrow = in_narrow || narrow && lit * (1.0 - lit) > UNSEEN;
#endif
    // beyond the terminator a surface shades itself, whatever the map says of it
    return bias < 0.0 ? lit : lit * smoothstep(-0.2, 0.15, facing);
}
