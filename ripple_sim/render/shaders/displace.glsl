#version 430
// Vertices of a target, displaced along their smooth normals and put into the world: once a frame for all passes.
layout(local_size_x = 64) in;

#include "relief.glsl"

struct Vertex { float position[3], direction[3], sphere[3]; };
layout(std430, binding = 0) readonly buffer Rest { Vertex rest[]; };
layout(std430, binding = 1) writeonly buffer Moved { float moved[]; };

uniform mat3 rotation;
uniform vec3 origin;
uniform int count;

void main()
{
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count)
        return;
    Vertex v = rest[i];
    float height = relief_at(vec3(v.sphere[0], v.sphere[1], v.sphere[2])).w;
    vec3 local = vec3(v.position[0], v.position[1], v.position[2])
               + height * vec3(v.direction[0], v.direction[1], v.direction[2]);
    vec3 world = rotation * local + origin;
    moved[3 * i] = world.x;
    moved[3 * i + 1] = world.y;
    moved[3 * i + 2] = world.z;
}
