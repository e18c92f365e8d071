#version 410
// What may block a light: how much of the shadow map is covered, and that times the distance from the light [m] and times
// its square. Mipmaps of it are means over as much as the search for blockers steps over.
#include "glsl/frame.glsl"

VARYING vec2 screen;  // from -1 to 1

#stage vertex
void main()
{
    screen = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(screen, -1.0, 1.0);
}

#stage fragment
layout(binding = SHADOW_MAPS_UNIT) uniform sampler2D shadow_maps;

out vec4 fragment;

void main()
{
    vec2 place = 0.5 * screen + 0.5;
    int light = int(place.x * float(SHADOWS));
    // all of its 4 x 4 texels: with fewer, edges of shadows are ragged where penumbras are narrow
    vec4 depths[4] = vec4[](
        textureGatherOffset(shadow_maps, place, ivec2(-1, -1)), textureGatherOffset(shadow_maps, place, ivec2(1, -1)),
        textureGatherOffset(shadow_maps, place, ivec2(-1, 1)), textureGatherOffset(shadow_maps, place, ivec2(1, 1)));
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        vec4 covers = 1.0 - step(1.0, depths[i]), away = light_distance(shadows[light].depth, depths[i]);
        sum += vec3(dot(covers, vec4(1.0)), dot(covers, away), dot(covers, away * away));
    }
    fragment = vec4(sum / 16.0, 1.0);
}
