#version 430
// One triangle over the whole framebuffer, at a given depth, with its rays and what is the same all over the floor.
#include "glsl/ray_cast.glsl"
#include "gpu/hold_uniforms.glsl"
#include "visuals/environment.glsl"

uniform float level;
uniform vec2 span = vec2(1.0);  // of the framebuffer, in frames
uniform float reach = 1.0;      // of the viewport, in framebuffers

flat out vec3 focus_local;
flat out vec3 around;   // ambient light on the open floor, without the soft box of the key light
flat out vec3 key_box;  // and that
flat out vec3 floor_lit, floor_surround;  // radiance of the open floor by the lights, and by what is around

void main()
{
    vec2 corner = 4.0 * vec2(gl_VertexID == 1, gl_VertexID == 2);
    cast_ray(corner * span - 1.0);
    focus_local = along_floor(focus.xyz - floor_origin.xyz);
    around = ambient(floor_normal.xyz, vec3(0.0), vec3(0.0));
    key_box = diffuse_box(0, floor_normal.xyz);
    floor_lit = floor_albedo.rgb * (floor_light.rgb + key_box);
    floor_surround = floor_albedo.rgb * around;
    hold_uniforms();
    gl_Position = vec4(corner / reach - 1.0, 2.0 * level - 1.0, 1.0);
}
