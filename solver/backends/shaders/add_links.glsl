#version 430
// Add what other cells than quads give to links, each of which is listed once.
layout(std430, binding = 0) buffer Links { float links[]; };
layout(std430, binding = 1) readonly buffer Places { int places[]; };
layout(std430, binding = 2) readonly buffer Values { float values[]; };
uniform int count;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i < count) links[places[i]] += values[i];
}
