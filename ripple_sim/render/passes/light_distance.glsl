// Distance from a light [m] of a depth in its shadow map; after the frame's uniforms.
float light_distance(int light, float depth)
{
    vec4 d = shadows[light].depth;
    return (d.x * depth + d.y) / (d.z * depth + d.w);
}
