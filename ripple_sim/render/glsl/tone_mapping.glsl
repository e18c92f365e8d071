// From linear radiance to the frame's colours; with LINEAR the colours are the radiance.
#include "glsl/sampling.glsl"

// Linear colour, 0 to 1, to sRGB.
vec3 encoded(vec3 color)
{
#if LINEAR
    return color;
#else
    vec3 above = (1.0 + SRGB_OFFSET) * pow(color, vec3(1.0 / SRGB_EXPONENT)) - SRGB_OFFSET;
    return mix(SRGB_SLOPE * color, above, step(SRGB_BREAK, color));
#endif
}

// Linear radiance to sRGB: values below the shoulder keep hue and contrast, brighter values roll off towards white;
// `tone_mapped` in tone_mapping.py is the same.
vec3 tone_mapped(vec3 radiance)
{
#if LINEAR
    return clamp(radiance, 0.0, 65504.0);  // greatest half float
#else
    float peak = max(radiance.r, max(radiance.g, radiance.b));
    float excess = max(peak - SHOULDER, 0.0);
    float compressed = min(peak, SHOULDER) + (1.0 - SHOULDER) * excess / (excess + 1.0 - SHOULDER);
    vec3 color = radiance * (compressed / max(peak, 1e-4));
    color = mix(color, vec3(compressed), 1.0 - 1.0 / (1.0 + BLEACHING * excess));
    return encoded(color);
#endif
}

// Dither with interleaved gradient noise, which is spread evenly over any few neighbouring pixels.
vec3 dithered(vec3 color)
{
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    return LINEAR > 0 ? color : color + (noise - 0.5) / 255.0;
}
