in vec3 ray;
out vec4 fragment;
void main() { fragment = vec4(toneMapped(skyAt(normalize(ray), 0.0)), 1.0); }
