#version 430
#include "frame.glsl"
#include "studio.glsl"
#include "shadow.glsl"

layout(binding = 3) uniform sampler2D floor_openness;
layout(binding = 5) uniform sampler2D image;

uniform vec4 tiling;  // xy: repetitions a metre; z: 1 with an image

in vec2 plane;
out vec4 fragment;

void main()
{
    vec3 world = floor_origin.xyz + plane.x * floor_u.xyz + plane.y * floor_v.xyz;
    vec3 ray = world - eye.xyz;
    float away = length(ray);
    // the lamps stand near: a pool of light about the focus, and the backdrop's colour beyond
    float fade = smoothstep(0.4, 3.4, length(world - focus.xyz) / eye.w);

    vec3 albedo = mix(floor_albedo.rgb, texture(image, plane * tiling.xy + 0.5).rgb, tiling.z);
    float open = textureLod(floor_openness, (plane - floor_map.xy) / (2.0 * floor_map.z) + 0.5, 1.0).r;
    float facing = max(dot(floor_normal.xyz, key_direction.xyz), 0.0);
    float shadow = fade < 1.0 ? key_visibility(world, floor_normal.xyz, 0.0) : 1.0;
    vec3 light = key_radiance.rgb * facing * shadow + ambient(floor_normal.xyz, vec3(0.0)) * (0.15 + 0.85 * open);
    vec3 radiance = mix(albedo * light, backdrop(ray / away), fade);
    fragment = vec4(developed(radiance), 1.0);
}
