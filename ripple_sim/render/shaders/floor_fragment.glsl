#version 430
// Pixels that show the floor: with SHADOW those that a shadow may reach or that show something else too, without it all
// others.
#include "frame.glsl"
#include "samples.glsl"
#include "studio.glsl"
#include "development.glsl"
#include "lights.glsl"
#include "shadow.glsl"
#include "floor_ray.glsl"

layout(binding = 3) uniform sampler2D floor_openness;
layout(binding = 5) uniform sampler2D floor_image;

uniform vec4 tiling;   // texture coordinates a metre, and at the origin
uniform vec3 tint;     // that the image is multiplied by

flat in vec3 around;  // ambient light on the open floor
out vec4 fragment;

#if MIRROR
layout(binding = 14) uniform sampler2D mirror;  // the scene as the floor reflects it, sRGB

uniform float reflectance;
#endif

// A skybox goes on under the horizon, which the floor hides.
#if SKYBOX
const float HORIZON = 0.0;
#else
const float HORIZON = -1.0;
#endif

void main()
{
    vec3 way = way_of_pixel();
    float at = floor_distance(way);
    vec3 direction = normalize(way), world = eye.xyz + min(at, 1e6) * way, local = world - floor_origin.xyz;
    vec2 plane = vec2(dot(local, floor_u.xyz), dot(local, floor_v.xyz));
    // the lamps stand near: a pool of light about the focus, and the background's colour beyond
    float fade = at < MISSED ? smoothstep(floor_fade.x, floor_fade.y, length(world - focus.xyz) / eye.w) : 1.0;
#if IMAGE
    vec3 albedo = texture(floor_image, plane * tiling.xy + tiling.zw).rgb * tint;
#else
    vec3 albedo = floor_albedo.rgb;
#endif
    float open = textureLod(floor_openness, floor_place(world), 1.0).r;
#if SHADOW
    float shadow = key_visibility(world, floor_normal.xyz, 0.0);
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int solid = bitCount(covered(pixel, at));
    // The filters of neighbouring pixels are turned differently: their mean has half the noise. It is taken where all
    // four pixels of a block are of this pass: what others have reckoned is undefined.
    bool inside = all(lessThan(pixel | 1, textureSize(depths BASE_LEVEL)));
    bool whole = inside && block_mean(solid > 0 || at >= MISSED ? 1.0 : 0.0) == 0.0;
    float mean = block_mean(shadow);
    shadow = whole ? mean : shadow;
#else
    const float shadow = 1.0;
#endif
    vec3 light = vec3(0.0), unshaded = vec3(0.0);
    for (int i = 0; i < int(counts.y); ++i) {
        vec3 towards;
        vec3 arrives = incident(lights[i], world, towards) * max(dot(floor_normal.xyz, towards), 0.0);
        light += arrives * (i == 0 ? shadow : 1.0);
        unshaded += arrives;
    }
    light += around * (0.15 + 0.85 * open);
#if SHADOW
    float share = 1.0 - float(solid) / float(SAMPLES);
#else
    const float share = 1.0;
#endif
#if CUT_OUT
    // of the floor nothing but the shadows is kept
    fragment = vec4(vec3(0.0), share * (1.0 - fade) * (1.0 - light.g / max(unshaded.g + around.g, 1e-6)));
#else
    vec3 far = sky_at(at < MISSED ? vec3(direction.xy, max(direction.z, HORIZON)) : direction, 0.0);
    vec3 shown = developed(mix(albedo * light, far, fade));
#if MIRROR
    // MuJoCo blends the reflection in by its share, whatever the angle
    shown = mix(shown, textureLod(mirror, 0.5 + 0.5 * screen, 0.0).rgb, reflectance * (1.0 - fade));
#endif
    fragment = share * vec4(dithered(shown), 1.0);
#endif
}
