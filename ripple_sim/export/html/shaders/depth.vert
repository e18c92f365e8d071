layout(location = 0) in vec3 inPoint;
uniform mat4 modelProjection;
void main() { gl_Position = modelProjection * vec4(inPoint, 1.0); }
