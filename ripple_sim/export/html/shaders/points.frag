// Lights points, one a texel; places come with heights. Where pixels are drawn by software, fine meshes of one colour are lit there.
uniform highp sampler2D places, normals; uniform mat4 model; uniform vec3 color; uniform float open;
out vec4 fragment;
void main() {
  vec4 place = texelFetch(places, ivec2(gl_FragCoord.xy), 0);
  vec3 point = (model * vec4(place.xyz, 1.0)).xyz, normal = mat3(model) * texelFetch(normals, ivec2(gl_FragCoord.xy), 0).xyz;
  if (open > 0.0 && dot(normal, eye - point) < 0.0) normal = -normal;
  fragment = shownAt(point, normal, color, vec3(0.0), place.w);
}
