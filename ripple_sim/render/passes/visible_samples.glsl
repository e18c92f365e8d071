// Samples of a pixel, as bits, that show solids; with LAYER those of a single object.
#include "gpu/g_buffer_read.glsl"
#include "glsl/ray.glsl"

#if LAYER
uniform int layer;  // number of the object
#endif

int visible_samples(ivec2 pixel)
{
    int solid = covered(pixel, floor_depth());
#if LAYER
    int own = 0;
    for (int s = 0; s < SAMPLES; ++s)
        own |= unpack_object(texelFetch(normals, pixel, s).z) == layer ? 1 << s : 0;
    solid &= own;
#endif
    return solid;
}
