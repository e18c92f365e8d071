#version 430
// Vertices of a target, displaced along their smooth normals and put into the world, and how much sky the bodies near by
// leave them: once a frame for all passes.
layout(local_size_x = 64) in;

#include "surfaces/height_maps.glsl"
#include "visuals/occluders.glsl"

struct Vertex { float position[3], direction[3], sphere[3]; };
layout(std430, binding = 0) readonly buffer Rest { Vertex rest[]; };
layout(std430, binding = 1) writeonly buffer Moved { vec4 moved[]; };
layout(std430, binding = 2) readonly buffer Midpoints { int midpoints[]; };  // in use besides all vertices of the mesh

uniform mat3 rotation;
uniform vec3 origin;
uniform int count, base_count;
uniform float resolution;
uniform float first_layer;
uniform float geom;
uniform int occluder_count;

void main()
{
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count)
        return;
    if (i >= base_count)
        i = midpoints[i - base_count];
    Vertex v = rest[i];
    vec3 sphere = vec3(v.sphere[0], v.sphere[1], v.sphere[2]);
    float height = spline_at(height_map, resolution, first_layer, sphere).w;
    vec3 direction = vec3(v.direction[0], v.direction[1], v.direction[2]);
    vec3 world = rotation * (vec3(v.position[0], v.position[1], v.position[2]) + height * direction) + origin;
    moved[i] = vec4(world, openness_to_bodies(world, rotation * direction, geom, occluder_count));
}
