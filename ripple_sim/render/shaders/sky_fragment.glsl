#version 430
// Pixels that show nothing but the background.
#include "frame.glsl"
#include "samples.glsl"
#include "studio.glsl"

out vec4 fragment;

void main()
{
    fragment = vec4(dithered(developed(backdrop(normalize(way_of_pixel())))), 1.0);
}
