#version 430
in vec4 in_moved;

uniform mat4 matrix;

out vec3 world;

void main()
{
    world = in_moved.xyz;
    gl_Position = matrix * vec4(world, 1.0);
}
