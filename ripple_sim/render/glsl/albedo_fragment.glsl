#version 430
// Linear colour and depth.
in vec3 albedo;

out vec4 fragment;

void main()
{
    fragment = vec4(albedo, gl_FragCoord.z);
}
