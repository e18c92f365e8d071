#version 430
in vec3 in_core;
in vec3 in_shell;
in mat3 in_rotation;
in vec3 in_origin;
in vec3 in_core_size;
in vec3 in_shell_size;
in vec4 in_color;  // linear; number in the table of objects

uniform mat4 matrix;

out vec3 albedo;

void main()
{
    albedo = in_color.rgb;
    vec3 local = in_core * in_core_size + in_shell * in_shell_size;
    gl_Position = matrix * vec4(in_rotation * local + in_origin, 1.0);
}
