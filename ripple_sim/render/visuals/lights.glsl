// Direction towards a light, and what arrives of it where nothing is in the way.
#include "gpu/frame_uniforms.glsl"

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
