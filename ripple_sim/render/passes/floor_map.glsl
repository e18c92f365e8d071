// The floor map; see floor_occlusion_fragment.glsl.
#include "gpu/frame_uniforms.glsl"

// r: ambient visibility; g: 1 where shadows may fall; b: share of the lights that arrives
layout(binding = FLOOR_MAP_UNIT) uniform sampler2D floor_visibility;
layout(binding = FLOOR_BOUNCE_UNIT) uniform sampler2D floor_bounce;  // light that objects throw on the floor, over pi

// Texture coordinates in the floor map of a point given along the floor's axes.
vec2 floor_map_position(vec2 local)
{
    return (local - floor_map.xy) / (2.0 * floor_map.z) + 0.5;
}
