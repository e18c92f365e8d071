in vec3 point, normal; flat in vec3 color; in vec2 uv; in float height;
uniform sampler2D image, glowImage;
uniform vec2 texels;  // least opacity of the texels that are drawn, and the opacity up to which they are drawn
out vec4 fragment;
void main() {
  vec3 albedo = color;
  vec3 emitted = vec3(0.0);
  float opacity = 1.0;
#ifdef TEXTURED
  vec4 texel = texture(image, uv);
  if (texel.a < texels.x || texel.a >= texels.y) discard;
  if (texels.y < 1.0) opacity = texel.a;
  albedo *= linear(texel.rgb);
#endif
#ifdef GLOWS
  emitted = linear(texture(glowImage, uv).rgb);
#endif
  fragment = opacity * shownAt(point, gl_FrontFacing ? normal : -normal, albedo, emitted, height);
}
