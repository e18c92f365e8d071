// A triangle that covers everything, behind all that is drawn, with the rays of its points from the eye.
uniform vec3 rayMiddle, rayRight, rayUp;
out vec3 ray;
void main() {
  vec2 p = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  ray = rayMiddle + p.x * rayRight + p.y * rayUp;
  gl_Position = vec4(p, 0.999999, 1.0);
}
