#version 430
// Squares of the target.
in vec2 in_corner;  // its lower left

uniform vec2 extent;

out vec2 screen;

void main()
{
    screen = in_corner + extent * vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = vec4(screen, 0.0, 1.0);
}
