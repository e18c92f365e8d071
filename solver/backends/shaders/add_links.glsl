#version 430
// Add the weights that links get from cells other than quads. Each link is listed once.
layout(std430, binding = 0) buffer Links { float links[]; };
layout(std430, binding = 1) readonly buffer Places { int places[]; };
layout(std430, binding = 2) readonly buffer Values { float values[]; };
uniform int count;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i < count) links[places[i]] += values[i];
}
