#version 410
// Vertices of a target, displaced along their smooth normals, in the world, and the ambient visibility that nearby geoms
// leave them: once a frame for all passes, captured in a buffer.
#include "glsl/height_maps.glsl"
#include "glsl/occluders.glsl"

in vec3 in_position, in_direction;
in vec2 in_lookup;  // where on the page the height is looked up [texels]

uniform mat3 rotation;
uniform vec3 origin;
uniform float layer;
uniform int occluders_near;

out vec4 moved;

void main()
{
    float height = spline_at(height_maps, vec3(in_lookup, layer)).w;
    vec3 world = rotation * (in_position + height * in_direction) + origin;
    moved = vec4(world, occluder_visibility(world, rotation * in_direction, occluders_near));
}
