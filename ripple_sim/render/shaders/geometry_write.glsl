#include "geometry.glsl"

layout(location = 0) out vec4 shape;  // normal without ripples; where the relief is looked up
layout(location = 1) out vec4 paint;  // two shares a channel; number of the object

// The colour is the square root of the albedo; `baked` holds the openness and half the thickness; `ink` is that of lines
// on top.
void store(vec3 normal, vec3 sphere, vec3 color, float object, vec2 baked, float ink)
{
    shape = vec4(folded(normal), folded(sphere));
    paint = vec4(joined(color.r, color.g), joined(color.b, ink), joined(baked.x, baked.y), object / 65535.0);
}
