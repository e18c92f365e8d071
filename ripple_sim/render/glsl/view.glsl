// What shaders of the view need at a vertex: its ray, and what is the same all over the floor.
#include "glsl/ray_cast.glsl"
#include "gpu/hold_uniforms.glsl"
#include "visuals/environment.glsl"

flat out vec3 focus_local;
flat out vec3 around;   // ambient light on the open floor, without the soft box of the key light
flat out vec3 key_box;  // and that
flat out vec3 floor_lit, floor_surround;  // radiance of the open floor by the lights, and by what is around

// `place` is the position in the frame, from -1 to 1.
void set_view(vec2 place)
{
    cast_ray(place);
    focus_local = along_floor(focus.xyz - floor_origin.xyz);
    around = ambient(floor_normal.xyz, vec3(0.0), vec3(0.0));
    key_box = diffuse_box(0, floor_normal.xyz);
    floor_lit = floor_albedo.rgb * (floor_light.rgb + key_box);
    floor_surround = floor_albedo.rgb * around;
    hold_uniforms();
}
