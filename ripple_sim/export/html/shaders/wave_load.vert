layout(location = 0) in vec2 inLoad;  // texel and force
uniform ivec2 size;
out float force;
void main() {
  int texel = int(inLoad.x);
  gl_Position = vec4((vec2(texel % size.x, texel / size.x) + 0.5) / vec2(size) * 2.0 - 1.0, 0.0, 1.0);
  gl_PointSize = 1.0;
  force = inLoad.y;
}
