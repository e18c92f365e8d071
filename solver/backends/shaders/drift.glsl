#version 430
// h += dt v. With SHIFT the velocities first get a shift, as texels respond to it.
#include "charts.glsl"

layout(std430, binding = 0) buffer Height { float h[]; };
layout(std430, binding = 1) buffer Velocity { float v[]; };
#ifdef SHIFT
layout(std430, binding = 2) readonly buffer Response { float response[]; };
#ifdef PARTS
layout(std430, binding = 3) readonly buffer Parts { float parts[]; };
layout(std430, binding = 4) readonly buffer Shifts { float shifts[]; };
#else
uniform float shift;
#endif
#endif
uniform float dt;

void main() {
    uint texel = gl_GlobalInvocationID.x;
    if (beyond(texel)) return;
    int p = address(texel);
#ifdef SHIFT
#ifdef PARTS
    float shift = shifts[int(parts[p])];
#endif
    v[p] += shift * response[p];
#endif
    h[p] += dt * v[p];
}
