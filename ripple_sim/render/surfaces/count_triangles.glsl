#version 430
// How many triangles come before each face's in its group of faces, and how many a group has.
layout(local_size_x = GROUP) in;
layout(std430, binding = BEFORE_BINDING) writeonly buffer Before { int before[]; };
layout(std430, binding = TOTALS_BINDING) writeonly buffer Totals { int totals[]; };

#include "surfaces/face_splits.glsl"
#include "surfaces/group_sum.glsl"

uniform int count;

void main()
{
    int face = int(gl_GlobalInvocationID.x);
    int triangles = face < count ? 1 + splits_of(face) : 0;
    int sum = sum_up_to(triangles);
    if (face < count)
        before[face] = sum - triangles;
    if (gl_LocalInvocationIndex == GROUP - 1)
        totals[gl_WorkGroupID.x] = sum;
}
