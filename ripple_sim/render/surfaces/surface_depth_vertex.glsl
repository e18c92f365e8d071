#version 430
in vec4 in_moved;

uniform mat4 view_projection;

void main()
{
    gl_Position = view_projection * vec4(in_moved.xyz, 1.0);
}
