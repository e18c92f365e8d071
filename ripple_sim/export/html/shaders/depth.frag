out vec2 blocker;
void main() { blocker = vec2(1.0, gl_FragCoord.z); }
