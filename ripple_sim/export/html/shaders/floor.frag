in vec2 plane;
in vec3 point, bright, dark, inMap;
uniform mat4 floorFrame; uniform vec4 floorTiling;
uniform sampler2D image;
out vec4 fragment;
void main() {
#if defined(PLAIN) && defined(SHADOW)
  fragment = vec4(sqrt(mix(dark, bright, shadowOn(inMap))), 1.0);
#elif defined(PLAIN)
  fragment = vec4(sqrt(bright), 1.0);
#else
  vec3 albedo = floorColor * linear(texture(image, plane * floorTiling.xy + floorTiling.zw).rgb);
  float shadow = 1.0;
#ifdef SHADOW
  shadow = shadowOn(inShadowMap(point, vec3(0.0)));
#endif
  fragment = vec4(floorAt(point, floorFrame[2].xyz, albedo, shadow), 1.0);
#endif
}
