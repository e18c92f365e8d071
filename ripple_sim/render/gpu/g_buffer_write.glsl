#include "gpu/g_buffer.glsl"

layout(location = 0) out vec4 shape;  // normal without ripples, number of the object, openness with half the thickness
layout(location = 1) out vec4 paint;  // where the height map is looked up; colour and ink, two shares a channel

// The colour is the square root of the albedo; `baked` holds the openness and half the thickness; `ink` is that of lines
// on top.
void store(vec3 normal, vec3 sphere, vec3 color, float object, vec2 baked, float ink)
{
    shape = vec4(folded(normal), object / 65535.0, joined(baked.x, baked.y));
    paint = vec4(folded(sphere), joined(color.r, color.g), joined(color.b, ink));
}
