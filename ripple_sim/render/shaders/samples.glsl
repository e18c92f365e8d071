// The samples of the geometry pass.
#if SAMPLES > 1
#define BUFFER sampler2DMS
#define BASE_LEVEL
#else
#define BUFFER sampler2D
#define BASE_LEVEL , 0
#endif
layout(binding = 8) uniform BUFFER depths;
layout(binding = 9) uniform BUFFER shapes;
layout(binding = 10) uniform BUFFER paints;

in vec2 screen;

// Mean over a block of 2 x 2 pixels.
float block_mean(float value)
{
    vec2 side = 1.0 - 2.0 * vec2(ivec2(gl_FragCoord.xy) & 1);
    value += 0.5 * side.x * dFdx(value);
    return value + 0.5 * side.y * dFdy(value);
}

// From the eye through the pixel, one metre along the camera's axis.
vec3 way_of_pixel()
{
    return ray.xyz + screen.x * ray_right.xyz + screen.y * ray_up.xyz;
}

float eye_distance(float depth)
{
    return ray.w * ray_right.w / (ray_right.w - depth * (ray_right.w - ray.w));
}

// Depth in the buffer of a distance along the camera's axis.
float buffer_depth(float at)
{
    return (ray_right.w - ray.w * ray_right.w / at) / (ray_right.w - ray.w);
}

// Samples, as bits, that a surface in front of the floor covers.
int covered(ivec2 pixel, float floor_at)
{
    float limit = min(buffer_depth(floor_at), 0.99999994);
    int solid = 0;
    for (int s = 0; s < SAMPLES; ++s)
        solid |= texelFetch(depths, pixel, s).r < limit ? 1 << s : 0;
    return solid;
}
