// One substep of the waves at a texel; law.js states the law. The half drift that begins a step is taken here as well, at every
// end of a link.
uniform highp sampler2D state;  // h [m] and v [m/s]
uniform highp sampler2D links;  // other end, elastic weight, viscous weight, part; link k of all texels lies k `height` rows up
uniform highp sampler2D coefficients;  // gain, decay, spring, push
uniform highp sampler2D load;  // [N]
uniform highp sampler2D acceleration;  // of each part [m/s^2]
uniform int linkCount, height;
uniform float before, after;  // drifts [s]
uniform float tension, ratio;  // by which the slider of speed multiplies elastic weights; of viscous to elastic weights [s]
out vec4 next;

vec2 drifted(ivec2 texel) {
  vec2 here = texelFetch(state, texel, 0).xy;
  return vec2(here.x + before * here.y, here.y);
}

void main() {
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec2 here = drifted(texel);
  float elastic = 0.0, viscous = 0.0;
  int part = 0;
  for (int k = 0; k < linkCount; k++) {
    vec4 link = texelFetch(links, texel + ivec2(0, k * height), 0);
    int other = int(link.x);
    vec2 across = drifted(ivec2(other % WIDTH, other / WIDTH)) - here;
    elastic += link.y * across.x;
    viscous += (ratio * link.y + link.z) * across.y;
    part = int(link.w);
  }
  vec4 c = texelFetch(coefficients, texel, 0);
  float force = tension * elastic + viscous + texelFetch(load, texel, 0).x;
  float v = c.y * here.y + (c.x * force - c.z * here.x) + c.w * texelFetch(acceleration, ivec2(part, 0), 0).x;
  next = vec4(here.x + after * v, v, 0.0, 1.0);
}
