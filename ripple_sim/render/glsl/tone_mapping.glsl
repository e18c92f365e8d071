// From linear radiance to the frame's colours; with LINEAR these are the radiance itself.
#include "glsl/sampling.glsl"

#if LINEAR
vec3 tone_mapped(vec3 radiance)
{
    return clamp(radiance, 0.0, 65504.0);  // what half floats hold
}

vec3 dithered(vec3 color)
{
    return color;
}
#else
// Linear radiance to sRGB: values below the shoulder keep hue and contrast, brighter ones roll off towards white;
// `tone_mapped` in tone_mapping.py is the same.
vec3 tone_mapped(vec3 radiance)
{
    float peak = max(radiance.r, max(radiance.g, radiance.b));
    float excess = max(peak - SHOULDER, 0.0);
    float compressed = min(peak, SHOULDER) + (1.0 - SHOULDER) * excess / (excess + 1.0 - SHOULDER);
    vec3 color = radiance * (compressed / max(peak, 1e-4));
    color = mix(color, vec3(compressed), 1.0 - 1.0 / (1.0 + BLEACHING * excess));
    vec3 above = (1.0 + SRGB_OFFSET) * pow(color, vec3(1.0 / SRGB_EXPONENT)) - SRGB_OFFSET;
    return mix(SRGB_SLOPE * color, above, step(SRGB_BREAK, color));
}

vec3 dithered(vec3 color)
{
    return color + (gradient_noise(gl_FragCoord.xy) - 0.5) / 255.0;
}
#endif
