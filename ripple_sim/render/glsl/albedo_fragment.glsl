#version 430
in vec3 albedo;

out vec4 fragment;

void main()
{
    fragment = vec4(albedo, 1.0);
}
