// Quadratic B-spline over 3 x 3 texels, from four bilinear taps: a surface whose normals have no kinks. A halo of one
// texel is enough, and where three charts meet all three give the same value. The place is one on a page of charts
// [texels], and the page's layer.
vec4 spline_at(sampler2DArray pages, vec3 place)
{
    vec2 size = vec2(textureSize(pages, 0).xy);
    vec2 texel = floor(place.xy);
    vec2 t = place.xy - texel - 0.5;
    vec2 left = 0.5 * (1.0 - t), right = 0.5 * (1.0 + t);
    vec2 low = texel - 0.5 + (0.75 - t * t) / (2.0 * left);
    vec2 high = texel + 0.5 + 0.5 * (0.5 + t) * (0.5 + t) / right;
    low /= size;
    high /= size;
    return left.y * (left.x * textureLod(pages, vec3(low.x, low.y, place.z), 0.0)
                     + right.x * textureLod(pages, vec3(high.x, low.y, place.z), 0.0))
         + right.y * (left.x * textureLod(pages, vec3(low.x, high.y, place.z), 0.0)
                      + right.x * textureLod(pages, vec3(high.x, high.y, place.z), 0.0));
}
