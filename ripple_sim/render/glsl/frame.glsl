// Uniforms of the frame for all shaders; contract.py describes the members.
struct Light { LIGHT_MEMBERS };

struct Shadow { SHADOW_MEMBERS };

layout(std140, binding = FRAME_BINDING) uniform Frame { FRAME_MEMBERS };

// Distance from a light [m] of a depth in its shadow map; `d` is the shadow's `depth`.
float light_distance(vec4 d, float depth)
{
    return (d.x * depth + d.y) / (d.z * depth + d.w);
}

vec4 light_distance(vec4 d, vec4 depths)
{
    return (d.x * depths + d.y) / (d.z * depths + d.w);
}
