// Light of the lights, without shadows, and of the surroundings: a skybox or a backdrop, and soft boxes that only
// reflections and ambient light see.
#include "glsl/frame.glsl"

// Radiance that arrives from a light, and the direction towards the light.
vec3 incident(Light light, vec3 position, out vec3 towards)
{
#if !NEAR_LIGHTS
    towards = light.direction.xyz;
    return light.radiance.rgb;
#endif
    vec3 offset = light.position.xyz - position;
    float away = max(length(offset), 1e-6);
    bool near = light.position.w > 0.0;
    towards = near ? offset / away : light.direction.xyz;
    float along = dot(towards, light.direction.xyz);
    float beam = smoothstep(light.direction.w, light.direction.w + 0.02, along) * pow(max(along, 0.0), light.radiance.w);
    // a light without a beam shines to all sides
    beam = light.direction.w > -1.0 ? beam : 1.0;
    return light.radiance.rgb * (near ? beam / dot(light.falloff.xyz, vec3(1.0, away, away * away)) : 1.0);
}

#if SKYBOX
layout(binding = SKYBOX_UNIT) uniform samplerCube skybox;
#endif

// Radiance of the background, blurred over a lobe of the given roughness.
vec3 sky_at(vec3 direction, float roughness)
{
#if SKYBOX
    // in MuJoCo's skyboxes +y is up
    vec3 radiance = textureLod(skybox, vec3(direction.x, direction.z, -direction.y), 8.0 * sqrt(roughness)).rgb;
#if BACKDROP
    return radiance;
#else
    return shown_far.z * radiance;
#endif
#else
    return mix(horizon.rgb, zenith.rgb, smoothstep(-0.1 - 0.2 * roughness, 0.8 + 0.2 * roughness, direction.z));
#endif
}

// Share of a lobe about a direction, with a blur, that meets a soft box.
float soft_box(vec3 direction, vec4 normal, vec4 tangent, float blur)
{
    float along = dot(direction, normal.xyz);
    vec2 hit = vec2(dot(direction, tangent.xyz), dot(direction, cross(normal.xyz, tangent.xyz))) / max(along, 1e-3);
    vec2 size = vec2(normal.w, tangent.w);
    vec2 inside = smoothstep(-blur, blur, size - abs(hit)) * (size / (size + 0.5 * blur));
    return along > 0.0 ? inside.x * inside.y : 0.0;
}

const vec2 LOBE = vec2(0.04, 0.9);  // half width of a mirror's lobe, and its growth with roughness

// Roughness of a lobe that is widened by the variance of normals in the pixel. Reflections turn twice as far as normals, and
// the variance of a smooth step is a fifth of the square of its half width.
float roughened(float roughness, float variance)
{
    float width = LOBE.x + LOBE.y * roughness;
    return (sqrt(width * width + 10.0 * variance) - LOBE.x) / LOBE.y;
}

// Radiance that a lobe about a direction, of a roughness, collects; `bounce` is the radiance from below.
vec3 environment(vec3 direction, float roughness, vec3 bounce)
{
    float width = LOBE.x + LOBE.y * roughness;
    vec3 radiance = mix(bounce, 0.75 * sky_at(direction, roughness), smoothstep(-width, width, direction.z));
    for (int i = 0; i < SOFT_BOXES; ++i)
        radiance += soft_box_radiance[i].rgb * soft_box(direction, soft_box_normal[i], soft_box_tangent[i], width);
    return radiance;
}

// Light of a soft box on a diffuse surface, over pi.
vec3 diffuse_box(int i, vec3 normal)
{
    float wrapped = max(0.35 + 0.65 * dot(normal, soft_box_normal[i].xyz), 0.0);
    float size = soft_box_normal[i].w * soft_box_tangent[i].w * 0.13;
    return sky.w * soft_box_radiance[i].rgb * size * wrapped * wrapped;
}

// Ambient light on a diffuse surface, over pi. The first soft box is at the key light's place: `key` is the share of its
// light that arrives.
vec3 ambient(vec3 normal, vec3 bounce, vec3 key)
{
    vec3 radiance = mix(bounce, sky.rgb, 0.5 + 0.5 * normal.z) + key * diffuse_box(0, normal);
    for (int i = 1; i < SOFT_BOXES; ++i)
        radiance += diffuse_box(i, normal);
    return radiance;
}
