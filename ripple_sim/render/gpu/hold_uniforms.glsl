// Hands what every pixel needs of the frame's uniforms to the fragment shader, as flat varyings; see held_uniforms.glsl.
#include "gpu/frame_uniforms.glsl"

#if HOLD_UNIFORMS
flat out vec4 held_eye, held_floor_origin, held_sky;
flat out vec3 held_floor_u, held_floor_v, held_floor_normal, held_floor_albedo, held_floor_light, held_floor_map;
flat out vec3 held_zenith, held_horizon;
flat out vec2 held_floor_fade;
flat out vec4 held_box_normal[SOFT_BOXES], held_box_tangent[SOFT_BOXES];
flat out vec3 held_box_radiance[SOFT_BOXES];
flat out vec3 held_light_direction[HELD_LIGHTS], held_light_radiance[HELD_LIGHTS];
flat out mat4 held_shadow_matrix;
flat out vec4 held_shadow_depth;
flat out vec3 held_shadow_width, held_shadow_penumbra;
flat out vec4 held_counts;

void hold_uniforms()
{
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
}
#else
void hold_uniforms() {}
#endif
