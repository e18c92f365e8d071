#version 430
// Links where the wave step reads them.
layout(local_size_x = LIST_GROUP) in;
layout(std430, binding = 0) readonly buffer Links { vec4 links[]; };
layout(std430, binding = 1) readonly buffer Pairs { ivec2 pairs[]; };  // place, and address in the stencil
layout(std430, binding = 2) writeonly buffer Stencil { vec4 w[]; };
uniform int count;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i < count) w[pairs[i].y] = links[pairs[i].x];
}
