#version 430
// Hand the part of the elastic height that is beyond the yield height over to the permanent one.
layout(local_size_x = 64) in;
#include "layout.glsl"
layout(std430, binding = 0) buffer Height { float h[]; };
layout(std430, binding = 1) buffer Dent { float dent[]; };
layout(std430, binding = 2) readonly buffer YieldHeight { float limit[]; };

void main() {
    ivec3 t = ivec3(gl_GlobalInvocationID);
    if (!inside(t)) return;
    int i = padded_index(t);
    float most = limit[texel_index(t)];
    float kept = clamp(h[i], -most, most);
    dent[i] += h[i] - kept;
    h[i] = kept;
}
