#version 430
// Cuts every face into 1 to 4 triangles by the midpoints of its sides that are used, as adaptive_tessellation.py does.
layout(local_size_x = GROUP) in;
layout(std430, binding = BEFORE_BINDING) readonly buffer Before { int before[]; };
layout(std430, binding = TOTALS_BINDING) readonly buffer Totals { int totals[]; };
layout(std430, binding = INDICES_BINDING) writeonly buffer Indices { int indices[]; };

#include "surfaces/face_splits.glsl"

uniform int count;

int next;

void emit(int a, int b, int c)
{
    indices[3 * next] = a;
    indices[3 * next + 1] = b;
    indices[3 * next + 2] = c;
    next++;
}

void main()
{
    int face = int(gl_GlobalInvocationID.x);
    if (face >= count)
        return;
    next = before[face] + totals[gl_WorkGroupID.x];
    int splits = splits_of(face), first = 0;
    // turn the face so that its only split side, or its only whole one, is side 0
    if (splits == 1 || splits == 2)
        while (is_split(face, first) != (splits == 1))
            first++;
    int second = (first + 1) % 3, third = (first + 2) % 3;
    int a = faces[face].corners[first], b = faces[face].corners[second], c = faces[face].corners[third];
    int m = faces[face].middles[first], n = faces[face].middles[second], o = faces[face].middles[third];
    if (splits == 0) {
        emit(a, b, c);
    } else if (splits == 1) {
        emit(a, m, c);
        emit(m, b, c);
    } else if (splits == 2) {
        emit(o, n, c);
        // the median to the longer side is the shorter diagonal of the rest
        bool longer = faces[face].ranks[second] >= faces[face].ranks[third];
        emit(a, b, longer ? n : o);
        emit(longer ? a : b, n, o);
    } else {
        emit(a, m, o);
        emit(b, n, m);
        emit(c, o, n);
        emit(m, n, o);
    }
}
