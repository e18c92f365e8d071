#version 410
// Blockers of a light: the covered share of the shadow map, and the share times the distance from the light [m], and times
// the square of the distance. The search for blockers takes the mipmap whose texels are as wide as its steps.
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
    // all 4 x 4 texels of the shadow map: with fewer, edges of shadows are ragged where penumbras are narrow
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
