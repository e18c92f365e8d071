// How much of the first lamp's light does not reach the floor, by places of the shadow map. All that it covers lies above the
// floor, so shadows are means of that, as wide as the mean depth makes penumbras; what is near is looked for in two steps.
#define WIDEST_SEARCH 0.06  // [widths of the map]; SIZE: texels along a side of the map
uniform sampler2D blockers;  // share of a texel that is covered, and that times the depth
uniform float softness;
out vec4 shade;
vec2 covered(vec2 at, float radius) {
  float level = max(log2(0.7 * radius * SIZE), 0.0), off = exp2(level) / (2.0 * SIZE);
  return 0.25 * (textureLod(blockers, at + off, level).xy + textureLod(blockers, at - off, level).xy +
    textureLod(blockers, at + vec2(off, -off), level).xy + textureLod(blockers, at + vec2(-off, off), level).xy);
}
float penumbra(vec2 found) { return softness * max(gl_FragCoord.z - found.y / found.x, 0.0); }
void main() {
  vec2 at = gl_FragCoord.xy / (0.5 * SIZE), found = covered(at, WIDEST_SEARCH);
  shade = vec4(0.0);
  if (found.x > 1e-4) {
    found = covered(at, penumbra(found));
    if (found.x > 1e-4) {  // what lies less than a texel above the floor casts nothing: about what stands there, texels are covered in part
      found = covered(at, penumbra(found)); shade = vec4(clamp((gl_FragCoord.z * found.x - found.y) * SIZE - found.x, 0.0, found.x));
    }
  }
}
