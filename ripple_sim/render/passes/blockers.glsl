// What blocks the light, from means over parts of the shadow maps.
#include "passes/shadow_map.glsl"

layout(binding = BLOCKERS_UNIT) uniform sampler2D blockers;  // see blockers_fragment.glsl

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
