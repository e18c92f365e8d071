in vec3 point, normal; flat in vec3 color; in vec2 uv; in float height;
uniform sampler2D image;
out vec4 fragment;
void main() {
  vec3 albedo = color;
#ifdef TEXTURED
  vec4 texel = texture(image, uv);
  if (texel.a < 0.5) discard;  // a hole
  albedo *= linear(texel.rgb);
#endif
  fragment = shownAt(point, gl_FrontFacing ? normal : -normal, albedo, height);
}
