#version 430
// Turns each group's number of triangles into that of all before it; the number of all goes into the draw call.
layout(local_size_x = GROUP) in;
layout(std430, binding = TOTALS_BINDING) buffer Totals { int totals[]; };
layout(std430, binding = COMMAND_BINDING) writeonly buffer Command { int index_count; };

#include "surfaces/group_sum.glsl"

void main()
{
    int thread = int(gl_LocalInvocationIndex), groups = totals.length();
    int share = (groups + GROUP - 1) / GROUP, first = thread * share, last = min(first + share, groups);
    int own = 0;
    for (int i = first; i < last; i++)
        own += totals[i];
    int sum = sum_up_to(own);
    if (thread == GROUP - 1)
        index_count = 3 * sum;
    sum -= own;
    for (int i = first; i < last; i++) {
        int here = totals[i];
        totals[i] = sum;
        sum += here;
    }
}
