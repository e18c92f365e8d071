in vec4 shown;
out vec4 fragment;
void main() { fragment = shown; }
