#version 430
// Pixels that show nothing but the background.
#include "frame.glsl"
#include "samples.glsl"
#include "studio.glsl"
#include "development.glsl"

out vec4 fragment;

void main()
{
    fragment = vec4(dithered(developed(sky_at(normalize(way_of_pixel()), 0.0))), 1.0);
}
