#version 430
#include "gpu/g_buffer_write.glsl"
#include "visuals/texture_mapping.glsl"

in vec3 normal;
in vec3 mapped;
flat in vec4 color;  // linear; w: number of the object
flat in vec4 tiling;

void main()
{
    vec3 albedo = textured(color.rgb, mapped, tiling);
    write_g_buffer(normal, vec2(0.0), sqrt(albedo), pack_object(color.w, false), vec2(1.0), 0.0);
}
