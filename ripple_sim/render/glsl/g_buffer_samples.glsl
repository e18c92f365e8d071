// The samples of the G-buffer. With LAYER only the samples of a single, transparent object count.
#include "glsl/g_buffer.glsl"
#include "glsl/view.glsl"

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

#if LAYER
uniform int layer;  // number of the object
#endif

// Bits of the samples of a pixel that show solids in front of the floor; with LAYER, that show the object.
int visible_samples(ivec2 pixel)
{
    float limit = min(floor_depth(), 0.99999994);
    int visible = 0;
    for (int s = 0; s < SAMPLES; ++s) {
        bool solid = texelFetch(depths, pixel, s).r < limit;
#if LAYER
        solid = solid && unpack_object(texelFetch(normals, pixel, s).z) == layer;
#endif
        visible |= solid ? 1 << s : 0;
    }
    return visible;
}
