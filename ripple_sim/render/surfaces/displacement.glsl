#version 430
// Vertices of a target, displaced along their smooth normals, in the world, and the ambient visibility that nearby geoms
// leave them: once a frame for all passes.
layout(local_size_x = VERTEX_GROUP) in;

#include "glsl/height_maps.glsl"
#include "glsl/occluders.glsl"

struct Vertex { float position[3], direction[3], place[2]; };
layout(std430, binding = REST_VERTICES_BINDING) readonly buffer RestVertices { Vertex rest[]; };
layout(std430, binding = MOVED_VERTICES_BINDING) writeonly buffer MovedVertices { vec4 moved[]; };
layout(std430, binding = MIDPOINTS_BINDING) readonly buffer Midpoints { int midpoints[]; };

uniform mat3 rotation;
uniform vec3 origin;
uniform int count, base_count;
uniform float layer;
uniform int occluders_near;
uniform bool flagged;  // midpoints are not a list of those in use, but say of each whether it is

void main()
{
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count)
        return;
    if (i >= base_count) {
        int midpoint = midpoints[i - base_count];
        if (flagged && midpoint == 0)
            return;
        i = flagged ? i : midpoint;
    }
    Vertex v = rest[i];
    float height = spline_at(height_maps, vec3(v.place[0], v.place[1], layer)).w;
    vec3 direction = vec3(v.direction[0], v.direction[1], v.direction[2]);
    vec3 world = rotation * (vec3(v.position[0], v.position[1], v.position[2]) + height * direction) + origin;
    moved[i] = vec4(world, occluder_visibility(world, rotation * direction, occluders_near));
}
