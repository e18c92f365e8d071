#version 430
// Give the copies of each link their mean, times a factor, which is 0 where there is no link.
layout(std430, binding = 0) buffer Links { float links[]; };
layout(std430, binding = 1) readonly buffer Copies { int copies[]; };
layout(std430, binding = 2) readonly buffer Groups { ivec2 groups[]; };  // first copy, one after the last
uniform int count;
uniform float factor;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count) return;
    float total = 0.0;
    for (int k = groups[i].x; k < groups[i].y; k++) total += links[copies[k]];
    for (int k = groups[i].x; k < groups[i].y; k++) links[copies[k]] = factor * total / float(groups[i].y - groups[i].x);
}
