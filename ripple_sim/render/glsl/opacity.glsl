// Opacity of a flat texture; TEXELS is one of `Texels` in contract.py. Include it behind texture_mapping.glsl.
const float OPAQUE_FROM = 0.95;  // edges of opaque texels are a little clear where texels are interpolated
const float CLEAR_UP_TO = 0.02;
const float HALF_OPAQUE = 0.5;
const float COARSEST_LEVEL = 3.0;  // coarser mipmaps mix the blocks of a packed image (see packing.py)

float texel_opacity(vec2 place)
{
    return textureLod(image, place, min(textureQueryLod(image, place).y, COARSEST_LEVEL)).a;
}

// Whether a texel of an opacity is drawn.
bool is_drawn(float opacity)
{
#if TEXELS == HALF_OPAQUE_TEXELS
    return opacity >= HALF_OPAQUE;
#elif TEXELS == OPAQUE_TEXELS
    return opacity >= OPAQUE_FROM;
#else
    return opacity > CLEAR_UP_TO && opacity < OPAQUE_FROM;
#endif
}
