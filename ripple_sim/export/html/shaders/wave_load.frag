in float force;
out vec4 shown;
void main() { shown = vec4(force, 0.0, 0.0, 1.0); }
