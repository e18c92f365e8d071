#version 430
// The links that start in each place, of the quads on either side. Quads beyond a chart have weights of 0.
layout(std430, binding = 0) readonly buffer Sides { float sides[]; };
layout(std430, binding = 1) writeonly buffer Links { float links[]; };  // east, north, north-east, and across that
uniform int count, width;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count) return;
    float below = i < width ? 0.0 : sides[count + i - width], west = i < 1 ? 0.0 : sides[3 * count + i - 1];
    links[i] = below + sides[i];
    links[count + i] = west + sides[2 * count + i];
    links[2 * count + i] = sides[4 * count + i];
    links[3 * count + i] = sides[5 * count + i];
}
