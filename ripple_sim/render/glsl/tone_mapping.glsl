// From linear radiance to the picture; with LINEAR that is the radiance itself.
float gradient_noise(vec2 pixel)
{
    return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))));
}

#if LINEAR
vec3 developed(vec3 radiance)
{
    return clamp(radiance, 0.0, 65504.0);  // what half floats hold
}

vec3 dithered(vec3 color)
{
    return color;
}
#else
// Linear radiance to sRGB: values under the shoulder keep hue and contrast, brighter ones roll off towards white.
vec3 developed(vec3 radiance)
{
    const float shoulder = 0.72;
    float peak = max(radiance.r, max(radiance.g, radiance.b));
    float excess = max(peak - shoulder, 0.0);
    float compressed = min(peak, shoulder) + (1.0 - shoulder) * excess / (excess + 1.0 - shoulder);
    vec3 color = radiance * (compressed / max(peak, 1e-4));
    color = mix(color, vec3(compressed), 1.0 - 1.0 / (1.0 + 0.18 * excess));
    return mix(12.92 * color, 1.055 * pow(color, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, color));
}

vec3 dithered(vec3 color)
{
    return color + (gradient_noise(gl_FragCoord.xy) - 0.5) / 255.0;
}
#endif
