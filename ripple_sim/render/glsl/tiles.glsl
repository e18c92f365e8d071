// Square tiles of the frame: tile i is two triangles of the vertices 4 i to 4 i + 3. Only tiles of one kind are drawn.
layout(binding = TILE_KINDS_UNIT) uniform usampler2D tile_kinds;  // a texel a tile

uniform vec2 extent;  // of a tile, where the frame extends from -1 to 1
uniform uint kind;

ivec2 tile()
{
    int number = gl_VertexID >> 2, columns = textureSize(tile_kinds, 0).x;
    return ivec2(number % columns, number / columns);
}

// Position of a vertex in the frame, from -1 to 1.
vec2 tile_corner()
{
    return extent * vec2(tile() + ivec2(gl_VertexID & 1, gl_VertexID >> 1 & 1)) - 1.0;
}

// Clip coordinates of a vertex at a depth from 0 to 1; tiles of other kinds lie outside the frame.
vec4 on_tile(float depth)
{
    vec4 outside = vec4(vec3(2.0), 1.0);
    return texelFetch(tile_kinds, tile(), 0).r == kind ? vec4(tile_corner(), 2.0 * depth - 1.0, 1.0) : outside;
}
