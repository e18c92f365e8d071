#version 430
// v += shift as texels respond to it, then h += dt v.
#include "charts.glsl"

layout(std430, binding = 0) buffer Height { float h[]; };
layout(std430, binding = 1) buffer Velocity { float v[]; };
layout(std430, binding = 2) readonly buffer Response { float response[]; };
#ifdef PARTS
layout(std430, binding = 3) readonly buffer Parts { float parts[]; };
layout(std430, binding = 4) readonly buffer Shifts { float shifts[]; };
#else
uniform float shift;
#endif
uniform float dt;

void main() {
    int p = address(int(gl_GlobalInvocationID.x));
    if (p < 0) return;
#ifdef PARTS
    float shift = shifts[int(parts[p])];
#endif
    v[p] += shift * response[p];
    h[p] += dt * v[p];
}
