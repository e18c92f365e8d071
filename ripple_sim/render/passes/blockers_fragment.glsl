#version 430
// What may block a light: how much of the shadow map is covered, and that times the distance from the light [m]. Mipmaps
// of it are means over as much as the search for blockers steps over.
#include "gpu/frame_uniforms.glsl"
#include "passes/light_distance.glsl"

layout(binding = SHADOW_MAPS_UNIT) uniform sampler2D shadow_maps;

in vec2 screen;
out vec4 fragment;

void main()
{
    vec2 place = 0.5 * screen + 0.5;
    int light = int(place.x * float(SHADOWS));
    vec4 depths = textureGather(shadow_maps, place);  // four of sixteen texels
    vec4 covers = 1.0 - step(1.0, depths);
    float covered = dot(covers, vec4(0.25)), depth = dot(covers, depths) / max(4.0 * covered, 1.0);
    fragment = vec4(covered, covered * light_distance(light, depth), 0.0, 1.0);
}
