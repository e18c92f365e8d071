layout(location = 0) in vec3 inPoint;
uniform sampler2D colors; uniform mat4 modelProjection;
out vec4 shown;
void main() {
  shown = texelFetch(colors, ivec2(gl_VertexID & 255, gl_VertexID >> 8), 0);
  gl_Position = modelProjection * vec4(inPoint, 1.0);
}
