#version 430
in vec3 in_world;

uniform mat4 view_projection;

void main()
{
    gl_Position = view_projection * vec4(in_world, 1.0);
}
