#version 430
#include "frame.glsl"
#include "studio.glsl"

uniform mat4 screen_to_world;

in vec2 screen;
out vec4 fragment;

void main()
{
    vec4 far = screen_to_world * vec4(screen, 1.0, 1.0);
    fragment = vec4(developed(backdrop(normalize(far.xyz / far.w - eye.xyz))), 1.0);
}
