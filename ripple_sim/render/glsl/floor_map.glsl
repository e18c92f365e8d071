// The floor map; see floor_occlusion.glsl.
#include "glsl/frame.glsl"

layout(binding = FLOOR_MAP_UNIT) uniform sampler2D floor_visibility;  // r: ambient visibility; g: 1 where shadows may fall
// The floor as solids see it. r: ambient visibility; g: share of the lights that arrives. It has 8 bits, which software
// drivers filter in half the time; on the floor itself the steps would be visible.
layout(binding = FLOOR_SEEN_UNIT) uniform sampler2D floor_seen;
layout(binding = FLOOR_BOUNCE_UNIT) uniform sampler2D floor_bounce;  // light that objects throw on the floor, over pi

// Texture coordinates in the floor map of a point given along the floor's axes.
vec2 floor_map_position(vec2 local)
{
    return (local - floor_map.xy) / (2.0 * floor_map.z) + 0.5;
}
