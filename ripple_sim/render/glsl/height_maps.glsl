// The height maps of all targets: gradient (xyz) and height (w), a page of charts for each target. Between texels they are
// quadratic B-splines over 3 x 3 texels, so that normals have no kinks. A halo of one texel is enough, and where three charts
// meet all three give the same value.
layout(binding = HEIGHT_MAPS_UNIT) uniform sampler2DArray height_maps;

// Weights of the texels before, at and after the nearest one, along both axes, for a place at a distance from its centre
// [texels]; `spline_weights` in spline.py is the same.
mat3x2 spline_weights(vec2 t)
{
    return mat3x2(0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t));
}

// Four bilinear taps that give the value of the spline; each takes half of the texel in the middle. `low` and `high` are
// corners of the rectangle of taps [texels], `share` is the weight of the higher taps along each axis.
struct SplineTaps { vec2 low, high, share; };

// Taps for a place on a page of charts [texels].
SplineTaps spline_taps(vec2 place)
{
    vec2 texel = floor(place);
    mat3x2 weights = spline_weights(place - texel - 0.5);
    vec2 half_middle = 0.5 * weights[1], low = weights[0] + half_middle, high = weights[2] + half_middle;
    return SplineTaps(texel - 0.5 + half_middle / low, texel + 0.5 + weights[2] / high, high);
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

// Widths of a pixel [texels] from which ripples begin to be averaged over the pixel, and are averaged completely.
const vec2 WIDE = vec2(1.0, 2.0);

// Mean gradient and height of a pixel, at a place on the page [texels] and in a layer. `across` and `up` lead to the
// neighbouring pixels [texels]. `chart` is the corner of the chart with its halo, and its side; a side of 0 means no height
// map. `variance` is the variance of the gradient in the pixel, as far as texels show it.
vec4 seen_at(vec3 place, vec2 across, vec2 up, vec3 chart, out float variance)
{
    float wide = smoothstep(WIDE.x, WIDE.y, max(length(across), length(up)));
    // the four taps of the spline move apart to the quarters of the pixel, each into the quarter on its side
    bool turned = abs(across.x) < abs(across.y);
    vec2 side = turned ? up : across, top = turned ? across : up;
    side *= side.x < 0.0 ? -0.25 : 0.25;
    top *= top.y < 0.0 ? -0.25 : 0.25;
    SplineTaps spline = spline_taps(place.xy);
    vec2 size = vec2(textureSize(height_maps, 0).xy), share = mix(spline.share, vec2(0.5), wide);
    vec4 seen = vec4(0.0);
    float square = 0.0;
    for (int i = 0; i < 4; ++i) {
        bvec2 high = bvec2((i & 1) == 1, (i & 2) == 2);
        vec2 quarter = place.xy + (high.x ? side : -side) + (high.y ? top : -top);
        quarter = clamp(quarter, chart.xy + 0.5, chart.xy + chart.z - 0.5);
        vec2 tap = mix(mix(spline.low, spline.high, high), quarter, wide), weight = mix(1.0 - share, share, high);
        vec4 there = textureLod(height_maps, vec3(tap / size, place.z), 0.0);
        seen += weight.x * weight.y * there;
        square += weight.x * weight.y * dot(there.xyz, there.xyz);
    }
    bool any = chart.z > 0.0;
    variance = any ? wide * max(square - dot(seen.xyz, seen.xyz), 0.0) : 0.0;
    return any ? seen : vec4(0.0);
}
