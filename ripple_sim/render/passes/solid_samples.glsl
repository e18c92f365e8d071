// Samples of a pixel, as bits, that show solids; with LAYER those of one object alone.
#if LAYER
uniform int layer;  // its number
#endif

int solid_samples(ivec2 pixel)
{
    int solid = covered(pixel, floor_depth());
#if LAYER
    int own = 0;
    for (int s = 0; s < SAMPLES; ++s)
        own |= int(texelFetch(shapes, pixel, s).z * 65535.0 + 0.5) == layer ? 1 << s : 0;
    solid &= own;
#endif
    return solid;
}
