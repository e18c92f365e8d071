#version 430
// The triangles of `AdaptiveTessellation`, in its order: which edges are split, how many triangles each face has, how many
// come before each group of faces, and the triangles themselves, in four shaders that run one after another.

// A face's corners, the midpoints of its sides as vertices, ranks of the sides by their length.
struct Face { int corners[3], middles[3], ranks[3]; };
layout(std430, binding = FACES_BINDING) readonly buffer Faces { Face faces[]; };
layout(std430, binding = SPLIT_BINDING) buffer Split { int split_edges[]; };
layout(std430, binding = BEFORE_BINDING) buffer Before { int before[]; };
layout(std430, binding = TOTALS_BINDING) buffer Totals { int totals[]; };

uniform int count;  // of edges or faces
uniform int first_midpoint;  // as a vertex

bool is_split(int face, int side)
{
    return split_edges[faces[face].middles[side] - first_midpoint] != 0;
}

int splits_of(int face)
{
    return int(is_split(face, 0)) + int(is_split(face, 1)) + int(is_split(face, 2));
}

// Sums over the threads of a group.
shared int sums[GROUP];

// The sum of the values of all threads up to this one.
int sum_up_to(int value)
{
    int thread = int(gl_LocalInvocationIndex);
    sums[thread] = value;
    for (int reach = 1; reach < GROUP; reach *= 2) {
        barrier();
        int before = thread >= reach ? sums[thread - reach] : 0;
        barrier();
        sums[thread] += before;
    }
    barrier();
    return sums[thread];
}

#stage split
// Mark the edges whose height at the midpoint differs from the mean of the heights at the ends. Heights are taken from
// whole texels: a texture unit's own weights are coarse.
#include "glsl/height_maps.glsl"

layout(std430, binding = LONG_EDGES_BINDING) readonly buffer Edges { ivec4 edges[]; };  // number, and lookups: ends, midpoint
// column and row on the page, offset in row and column
layout(std430, binding = LOOKUPS_BINDING) readonly buffer Places { vec4 places[]; };

uniform int layer;
uniform float tolerance;

float height_at(int lookup)
{
    vec4 place = places[lookup];
    mat3x2 weights = spline_weights(place.zw);  // of rows and columns
    float height = 0.0;
    for (int r = 0; r < 3; r++) {
        ivec3 texel = ivec3(ivec2(place.xy) + ivec2(0, r), layer);
        float left = texelFetch(height_maps, texel, 0).w, middle = texelFetch(height_maps, texel + ivec3(1, 0, 0), 0).w;
        float right = texelFetch(height_maps, texel + ivec3(2, 0, 0), 0).w;
        height += weights[r].x * (weights[0].y * left + weights[1].y * middle + weights[2].y * right);
    }
    return height;
}

void main()
{
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count)
        return;
    ivec4 edge = edges[i];
    float mean = 0.5 * (height_at(edge.y) + height_at(edge.z));
    split_edges[edge.x] = int(abs(height_at(edge.w) - mean) > tolerance);
}

#stage count
// How many triangles come before each face's in its group of faces, and how many a group has.
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

#stage add
// Replaces each group's number of triangles by the number of all triangles before the group. The total goes into the
// draw call.
layout(std430, binding = COMMAND_BINDING) writeonly buffer Command { int index_count; };

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

#stage write
// Cuts every face into 1 to 4 triangles by the midpoints of its sides that are used.
layout(std430, binding = INDICES_BINDING) writeonly buffer Indices { int indices[]; };

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
