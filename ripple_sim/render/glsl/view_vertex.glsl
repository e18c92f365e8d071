#version 430
// One triangle over the whole framebuffer, at a given depth, with its rays.
#include "glsl/view.glsl"

uniform float level;
uniform vec2 span = vec2(1.0);  // of the framebuffer, in frames
uniform float reach = 1.0;      // of the viewport, in framebuffers

void main()
{
    vec2 corner = 4.0 * vec2(gl_VertexID == 1, gl_VertexID == 2);
    set_view(corner * span - 1.0);
    gl_Position = vec4(corner / reach - 1.0, 2.0 * level - 1.0, 1.0);
}
