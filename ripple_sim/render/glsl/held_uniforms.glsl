// The uniforms of the frame that every pixel needs; to be included before anything else. Software drivers read a uniform
// again for every pixel, which took a tenth of a frame. With HOLD_UNIFORMS most uniforms reach the fragment stage as flat
// varyings instead. A GPU has room for few varyings.
#include "glsl/frame.glsl"

#if HOLD_UNIFORMS
flat VARYING vec4 held_eye, held_floor_origin, held_sky;
flat VARYING vec3 held_floor_u, held_floor_v, held_floor_normal, held_floor_albedo, held_floor_light, held_floor_map;
flat VARYING vec3 held_zenith, held_horizon;
flat VARYING vec2 held_floor_fade;
flat VARYING vec4 held_box_normal[SOFT_BOXES], held_box_tangent[SOFT_BOXES];
flat VARYING vec3 held_box_radiance[SOFT_BOXES];
flat VARYING vec3 held_light_direction[HELD_LIGHTS], held_light_radiance[HELD_LIGHTS];
flat VARYING mat4 held_shadow_matrix;
flat VARYING vec4 held_shadow_depth;
flat VARYING vec3 held_shadow_width, held_shadow_penumbra;
flat VARYING vec4 held_counts;
#endif

#stage vertex
void hold_uniforms()
{
#if HOLD_UNIFORMS
    held_eye = eye;
    held_floor_origin = floor_origin;
    held_sky = sky;
    held_floor_u = floor_u.xyz;
    held_floor_v = floor_v.xyz;
    held_floor_normal = floor_normal.xyz;
    held_floor_albedo = floor_albedo.rgb;
    held_floor_light = floor_light.rgb;
    held_floor_map = floor_map.xyz;
    held_zenith = zenith.rgb;
    held_horizon = horizon.rgb;
    held_floor_fade = floor_fade.xy;
    held_box_normal = soft_box_normal;
    held_box_tangent = soft_box_tangent;
    for (int i = 0; i < SOFT_BOXES; ++i)
        held_box_radiance[i] = soft_box_radiance[i].rgb;
    for (int i = 0; i < HELD_LIGHTS; ++i) {
        held_light_direction[i] = lights[i].direction.xyz;
        held_light_radiance[i] = lights[i].radiance.rgb;
    }
    held_shadow_matrix = shadows[0].matrix;
    held_shadow_depth = shadows[0].depth;
    held_shadow_width = shadows[0].width.xyz;
    held_shadow_penumbra = shadows[0].penumbra.xyz;
    held_counts = counts;
#endif
}

#stage fragment
#if HOLD_UNIFORMS
#define eye held_eye
#define floor_origin held_floor_origin
#define sky held_sky
#define floor_u held_floor_u
#define floor_v held_floor_v
#define floor_normal held_floor_normal
#define floor_albedo held_floor_albedo
#define floor_light held_floor_light
#define floor_map held_floor_map
#define zenith held_zenith
#define horizon held_horizon
#define floor_fade held_floor_fade
#define soft_box_normal held_box_normal
#define soft_box_tangent held_box_tangent
#define soft_box_radiance held_box_radiance
#define counts held_counts
#endif

// Lights and shadows by number. The numbers must be known when a shader is compiled; otherwise the block is read.
Light light_at(int i)
{
    Light light = lights[i];
#if HOLD_UNIFORMS && !NEAR_LIGHTS
    if (i < HELD_LIGHTS) {
        light.direction.xyz = held_light_direction[min(i, HELD_LIGHTS - 1)];
        light.radiance.rgb = held_light_radiance[min(i, HELD_LIGHTS - 1)];
    }
#endif
    return light;
}

Shadow shadow_at(int i)
{
    Shadow shadow = shadows[i];
#if HOLD_UNIFORMS
    if (i == 0) {
        shadow.matrix = held_shadow_matrix;
        shadow.depth = held_shadow_depth;
        shadow.width.xyz = held_shadow_width;
        shadow.penumbra.xyz = held_shadow_penumbra;
    }
#endif
    return shadow;
}
