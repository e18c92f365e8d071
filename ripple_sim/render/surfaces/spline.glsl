// Quadratic B-spline over 3 x 3 texels, from four bilinear taps: a surface whose normals have no kinks. A halo of one
// texel is enough, and where three charts meet all three give the same value.

// Corners of the rectangle of taps [texels], and what counts of the higher ones along each axis.
struct SplineTaps { vec2 low, high, share; };

// Taps for a place on a page of charts [texels].
SplineTaps spline_taps(vec2 place)
{
    vec2 texel = floor(place);
    vec2 t = place - texel - 0.5;
    vec2 left = 0.5 * (1.0 - t), right = 0.5 * (1.0 + t);
    return SplineTaps(texel - 0.5 + (0.75 - t * t) / (2.0 * left), texel + 0.5 + 0.5 * (0.5 + t) * (0.5 + t) / right,
                      right);
}

// Value at a place on a page [texels], and in a layer.
vec4 spline_at(sampler2DArray pages, vec3 place)
{
    SplineTaps taps = spline_taps(place.xy);
    vec2 size = vec2(textureSize(pages, 0).xy), low = taps.low / size, high = taps.high / size;
    return mix(mix(textureLod(pages, vec3(low, place.z), 0.0), textureLod(pages, vec3(high.x, low.y, place.z), 0.0),
                   taps.share.x),
               mix(textureLod(pages, vec3(low.x, high.y, place.z), 0.0), textureLod(pages, vec3(high, place.z), 0.0),
                   taps.share.x),
               taps.share.y);
}
