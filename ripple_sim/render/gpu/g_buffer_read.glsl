// The G-buffer, sample by sample.
#include "gpu/g_buffer.glsl"
#include "glsl/pixel_block.glsl"

#if SAMPLES > 1
#define BUFFER sampler2DMS
#define BASE_LEVEL
#else
#define BUFFER sampler2D
#define BASE_LEVEL , 0
#endif
layout(binding = DEPTHS_UNIT) uniform BUFFER depths;
layout(binding = NORMALS_UNIT) uniform BUFFER normals;
layout(binding = COLORS_UNIT) uniform BUFFER colors;

// Whether the pixel's block of 2 x 2 lies within the frame.
bool block_inside(ivec2 pixel)
{
    return all(lessThan(pixel | 1, textureSize(depths BASE_LEVEL)));
}

// Samples, as bits, covered by a surface in front of the floor, whose depth is given.
int covered(ivec2 pixel, float floor_depth)
{
    float limit = min(floor_depth, 0.99999994);
    int solid = 0;
    for (int s = 0; s < SAMPLES; ++s)
        solid |= texelFetch(depths, pixel, s).r < limit ? 1 << s : 0;
    return solid;
}
