// Direction towards a lamp, and what arrives of it where nothing is in the way.
vec3 incident(Light lamp, vec3 position, out vec3 towards)
{
#if !NEAR_LAMPS
    towards = lamp.direction.xyz;
    return lamp.radiance.rgb;
#endif
    vec3 offset = lamp.position.xyz - position;
    float away = max(length(offset), 1e-6);
    bool near = lamp.position.w > 0.0;
    towards = near ? offset / away : lamp.direction.xyz;
    float along = dot(towards, lamp.direction.xyz);
    float beam = smoothstep(lamp.direction.w, lamp.direction.w + 0.02, along) * pow(max(along, 0.0), lamp.radiance.w);
    // an open lamp shines to all sides
    beam = lamp.direction.w > -1.0 ? beam : 1.0;
    return lamp.radiance.rgb * (near ? beam / dot(lamp.falloff.xyz, vec3(1.0, away, away * away)) : 1.0);
}
