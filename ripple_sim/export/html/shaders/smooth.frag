// Smooths edges along themselves where no samples do so: fast approximate antialiasing (FXAA, Lottes 2009), by the brightness of green.
uniform sampler2D image;
out vec4 fragment;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 middle = texelFetch(image, at, 0);
  float a = texelFetch(image, at - 1, 0).g, b = texelFetch(image, at + 1, 0).g, c = texelFetch(image, at + ivec2(1, -1), 0).g, d = texelFetch(image, at + ivec2(-1, 1), 0).g;
  float low = min(min(a, b), min(c, d)), high = max(max(a, b), max(c, d));
  fragment = middle;
  if (max(high, middle.g) - min(low, middle.g) > 0.06) {  // returning or discarding would not spare software the rest
    vec2 size = vec2(textureSize(image, 0));
    vec2 along = vec2(a + c - b - d, b + c - a - d);
    along = clamp(along / (min(abs(along.x), abs(along.y)) + max(0.03 * (a + b + c + d), 0.008)), -8.0, 8.0) / size;
    vec2 place = gl_FragCoord.xy / size;
    vec4 inner = 0.5 * (texture(image, place - along / 6.0) + texture(image, place + along / 6.0));
    vec4 wide = 0.5 * inner + 0.25 * (texture(image, place - 0.5 * along) + texture(image, place + 0.5 * along));
    fragment = wide.g < min(low, middle.g) || wide.g > max(high, middle.g) ? inner : wide;
  }
}
