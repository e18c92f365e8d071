#version 430
// Which edges are split: those whose height at the midpoint is off the mean of those at the ends. Heights are those of
// the quadratic B-spline of spline.glsl, from whole texels: a texture unit's own weights are coarse.
layout(local_size_x = GROUP) in;
layout(std430, binding = LONG_EDGES_BINDING) readonly buffer Edges { ivec4 edges[]; };  // number, and lookups: ends, midpoint
// column and row on the page, offset in row and column
layout(std430, binding = LOOKUPS_BINDING) readonly buffer Places { vec4 places[]; };
layout(std430, binding = SPLIT_BINDING) writeonly buffer Split { int split_edges[]; };

#include "surfaces/height_maps.glsl"

uniform int count, layer;
uniform float tolerance;

vec3 weights(float t)
{
    return vec3(0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t));
}

float height_at(int lookup)
{
    vec4 place = places[lookup];
    vec3 rows = weights(place.z), columns = weights(place.w);
    float height = 0.0;
    for (int r = 0; r < 3; r++) {
        ivec3 texel = ivec3(ivec2(place.xy) + ivec2(0, r), layer);
        float left = texelFetch(height_maps, texel, 0).w, middle = texelFetch(height_maps, texel + ivec3(1, 0, 0), 0).w;
        float right = texelFetch(height_maps, texel + ivec3(2, 0, 0), 0).w;
        height += rows[r] * (columns.x * left + columns.y * middle + columns.z * right);
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
