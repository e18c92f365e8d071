#version 430
// The corners of the halo that show no texel: the mean of the three places about them, or, in a fixed rim, the height
// that makes the mean of all four 0.
layout(local_size_x = GROUP) in;
layout(std430, binding = 0) readonly buffer Corners { ivec4 corners[]; };  // place, and the three about it
uniform int means, count;  // the first ones are means

#include "waves/shaders/page.glsl"

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count) return;
    ivec4 corner = corners[i];
    vec4 sum = imageLoad(page, on_page(corner.y)) + imageLoad(page, on_page(corner.z)) + imageLoad(page, on_page(corner.w));
    vec4 there = imageLoad(page, on_page(corner.x));
    imageStore(page, on_page(corner.x), i < means ? sum / 3.0 : vec4(there.xyz, -sum.w));
}
