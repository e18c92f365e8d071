// Where the floor has one colour and no lamp is near, what it shows in light and in shadow is interpolated between the points of
// its cells, as squares, which are nearly proportional to light.
layout(location = 0) in vec2 inPlane;
uniform mat4 floorFrame, viewProjection;
out vec2 plane;
out vec3 point, bright, dark, inMap;
void main() {
  point = (floorFrame * vec4(inPlane, 0.0, 1.0)).xyz;
  plane = inPlane;
  gl_Position = viewProjection * vec4(point, 1.0);
#ifdef PLAIN
  vec3 up = floorFrame[2].xyz;
  bright = floorAt(point, up, floorColor, 1.0); dark = floorAt(point, up, floorColor, 0.0); inMap = inShadowMap(point, vec3(0.0));
  bright *= bright; dark *= dark;
#endif
}
