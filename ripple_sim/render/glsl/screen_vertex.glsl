#version 430
// One triangle over the whole framebuffer, at a given depth.
uniform float level;

out vec2 screen;

void main()
{
    screen = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(screen, 2.0 * level - 1.0, 1.0);
}
