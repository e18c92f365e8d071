// The samples of the geometry pass.
#if SAMPLES > 1
#define BUFFER sampler2DMS
#define BASE_LEVEL
#else
#define BUFFER sampler2D
#define BASE_LEVEL , 0
#endif
layout(binding = 8) uniform BUFFER depths;
layout(binding = 9) uniform BUFFER shapes;
layout(binding = 10) uniform BUFFER paints;

// Mean over a block of 2 x 2 pixels.
float block_mean(float value)
{
    vec2 side = 1.0 - 2.0 * vec2(ivec2(gl_FragCoord.xy) & 1);
    value += 0.5 * side.x * dFdx(value);
    return value + 0.5 * side.y * dFdy(value);
}

// Samples, as bits, that a surface in front of the floor covers, whose depth is given.
int covered(ivec2 pixel, float floor_depth)
{
    float limit = min(floor_depth, 0.99999994);
    int solid = 0;
    for (int s = 0; s < SAMPLES; ++s)
        solid |= texelFetch(depths, pixel, s).r < limit ? 1 << s : 0;
    return solid;
}
