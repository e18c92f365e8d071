// The shadow maps of the lights, what a point of a surface is in them, and what blocks the light, from means over parts of
// the maps. SHADOWS lights may cast shadows; their maps lie side by side.
#include "glsl/held_uniforms.glsl"

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

// The normal is that of the surface without ripples, `facing` its cosine to the light; `bias` as for `light_visibility`.
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

// Mean of what covers a map about a point, over so much of the map: see blockers.glsl.
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
