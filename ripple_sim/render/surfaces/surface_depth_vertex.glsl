#version 430
in vec4 in_moved;

uniform mat4 matrix;
uniform vec3 color;  // linear

out vec3 world, albedo;

void main()
{
    albedo = color;
    world = in_moved.xyz;
    gl_Position = matrix * vec4(world, 1.0);
}
