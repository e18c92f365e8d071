#version 430
// Copy the texels beyond the borders of charts into the halo.
layout(std430, binding = 0) buffer Field { float x[]; };
layout(std430, binding = 1) readonly buffer Pairs { ivec2 pairs[]; };  // (place in the halo, texel it shows)
uniform int count;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i < count) x[pairs[i].x] = x[pairs[i].y];
}
