// What a pixel sees of a height map: where it spans more than a texel, ripples are averaged over it.
#include "surfaces/height_maps.glsl"

const vec2 WIDE = vec2(1.0, 2.0);  // pixels of so many texels begin to be, and are, averaged over

// Gradient and height at a place on the page [texels], and in a layer. `across` and `up` lead to the pixels beside
// [texels], `chart` is the corner of the chart with its halo, and its side; without one there is nothing. `variance` is that
// of the gradient in the pixel, as far as texels show it.
vec4 seen_at(vec3 place, vec2 across, vec2 up, vec3 chart, out float variance)
{
    float wide = smoothstep(WIDE.x, WIDE.y, max(length(across), length(up)));
    vec4 seen = vec4(0.0);
    variance = 0.0;
    // loops, not branches: see light_visibility
    int narrow_looks = chart.z > 0.0 && wide < 1.0 ? 1 : 0, wide_looks = chart.z > 0.0 && wide > 0.0 ? 4 : 0;
    for (int i = 0; i < narrow_looks; ++i)
        seen = spline_at(height_maps, place);
    vec4 mean = vec4(0.0);
    float square = 0.0;
    for (int i = 0; i < wide_looks; ++i) {
        vec2 corner = 0.25 * ((i & 1) == 0 ? across : -across) + 0.25 * ((i & 2) == 0 ? up : -up);
        vec2 tap = clamp(place.xy + corner, chart.xy + 0.5, chart.xy + chart.z - 0.5);
        vec4 there = textureLod(height_maps, vec3(tap / vec2(textureSize(height_maps, 0).xy), place.z), 0.0);
        mean += 0.25 * there;
        square += 0.25 * dot(there.xyz, there.xyz);
    }
    variance = wide * max(square - dot(mean.xyz, mean.xyz), 0.0);
    return mix(seen, mean, wide);
}
