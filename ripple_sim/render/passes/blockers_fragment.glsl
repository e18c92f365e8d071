#version 430
// What may block a light: how much of the shadow map is covered, and that times the distance from the light [m] and times
// its square. Mipmaps of it are means over as much as the search for blockers steps over.
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
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        float away = light_distance(shadows[light].depth, depths[i]);
        sum += covers[i] * vec3(1.0, away, away * away);
    }
    fragment = vec4(0.25 * sum, 1.0);
}
