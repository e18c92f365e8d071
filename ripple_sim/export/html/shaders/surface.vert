layout(location = 0) in vec3 inPoint; layout(location = 1) in vec3 inNormal;
layout(location = 2) in vec2 inUv; layout(location = 3) in float inHeight; layout(location = 4) in vec3 inColor;
uniform mat4 model, viewProjection;
out vec3 point, normal; flat out vec3 color; out vec2 uv; out float height;
void main() {
  vec4 world = model * vec4(inPoint, 1.0);
  point = world.xyz; normal = mat3(model) * inNormal; color = inColor; uv = inUv; height = inHeight;
  gl_Position = viewProjection * world;
}
