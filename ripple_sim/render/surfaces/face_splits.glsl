// A face's corners, the midpoints of its sides as vertices, ranks of the sides by their length; which are split.
struct Face { int corners[3], middles[3], ranks[3]; };
layout(std430, binding = FACES_BINDING) readonly buffer Faces { Face faces[]; };
layout(std430, binding = SPLIT_BINDING) readonly buffer Split { int split_edges[]; };

bool is_split(int face, int side)
{
    return split_edges[faces[face].middles[side] - FIRST_MIDPOINT] != 0;
}

int splits_of(int face)
{
    return int(is_split(face, 0)) + int(is_split(face, 1)) + int(is_split(face, 2));
}
