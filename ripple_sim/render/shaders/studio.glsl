// The surroundings: a skybox or a backdrop, and three soft boxes that only reflections and ambient light see.
layout(binding = 7) uniform samplerCube skybox;

// MuJoCo's skyboxes have their own up.
vec3 sky_at(vec3 direction, float level)
{
    return textureLod(skybox, vec3(direction.x, direction.z, -direction.y), level).rgb;
}

vec3 backdrop(vec3 direction)
{
    vec3 plain = mix(horizon.rgb, zenith.rgb, smoothstep(-0.1, 0.8, direction.z));
    return counts.z > 0.0 ? sky_at(direction, 0.0) : plain;
}

// Share of a soft box that a lobe of the given blur about the direction meets.
float soft_box(vec3 direction, vec4 normal, vec4 tangent, float blur)
{
    float along = dot(direction, normal.xyz);
    vec2 hit = vec2(dot(direction, tangent.xyz), dot(direction, cross(normal.xyz, tangent.xyz))) / max(along, 1e-3);
    vec2 size = vec2(normal.w, tangent.w);
    vec2 inside = smoothstep(-blur, blur, size - abs(hit)) * (size / (size + 0.5 * blur));
    return along > 0.0 ? inside.x * inside.y : 0.0;
}

// Radiance that a lobe of the given roughness about the direction collects. `bounce` comes from below.
vec3 environment(vec3 direction, float roughness, vec3 bounce)
{
    // wide lobes get most of the lamps' light from the key light itself
    float width = 0.04 + 0.9 * roughness, lamps = mix(1.0, 0.3, smoothstep(0.08, 0.4, roughness));
    vec3 above = mix(horizon.rgb, zenith.rgb, smoothstep(-0.2, 0.9, direction.z));
    if (counts.z > 0.0)
        above = sky_at(direction, 2.0 + 6.0 * sqrt(roughness));
    vec3 radiance = mix(bounce, 0.75 * above, smoothstep(-width, width, direction.z));
    for (int i = 0; i < 3; ++i)
        radiance += lamps * lamp_radiance[i].rgb * soft_box(direction, lamp_normal[i], lamp_tangent[i], width);
    return radiance;
}

// Ambient light on a diffuse surface, over pi.
vec3 ambient(vec3 normal, vec3 bounce)
{
    vec3 radiance = mix(0.75 * bounce, sky.rgb, 0.5 + 0.5 * normal.z);
    for (int i = 0; i < 3; ++i) {
        float wrapped = max(0.35 + 0.65 * dot(normal, lamp_normal[i].xyz), 0.0);
        radiance += sky.w * lamp_radiance[i].rgb * (lamp_normal[i].w * lamp_tangent[i].w * 0.13) * wrapped * wrapped;
    }
    return radiance;
}

float gradient_noise(vec2 pixel)
{
    return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))));
}

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
