#version 430
// Forces along irregular links: each texel of a list gathers its own, so no two threads meet. With KICK they change the
// velocity, and drift the height; otherwise they are added to a result.
layout(std430, binding = 0) readonly buffer Field { float x[]; };
layout(std430, binding = 1) buffer Result { float result[]; };
layout(std430, binding = 3) readonly buffer Texels { int texels[]; };  // address, first link, one after the last
layout(std430, binding = 4) readonly buffer Links { ivec2 links[]; };  // address of the other end, bits of the weight
uniform int count;
#if KICK
layout(std430, binding = 2) buffer HeightNext { float h_next[]; };
uniform float dt;
#endif

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count) return;
    int here = texels[3 * i];
    float sum = 0.0;
    for (int k = texels[3 * i + 1]; k < texels[3 * i + 2]; k++)
        sum += intBitsToFloat(links[k].y) * (x[links[k].x] - x[here]);
    result[here] += sum;
#if KICK
    h_next[here] += dt * sum;
#endif
}
