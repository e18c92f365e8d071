layout(location = 0) in vec3 inPoint; layout(location = 1) in vec3 inNormal; layout(location = 2) in float inHeight;
uniform mat4 modelProjection; uniform float lift;
void main() { gl_Position = modelProjection * vec4(inPoint + (inHeight + lift) * inNormal, 1.0); }
