// Mean over a block of 2 x 2 pixels, or over the part of it that lies to the given sides.
float block_mean(float value, bvec2 sides)
{
    vec2 side = 1.0 - 2.0 * vec2(ivec2(gl_FragCoord.xy) & 1);
    value += sides.x ? 0.5 * side.x * dFdx(value) : 0.0;
    return value + (sides.y ? 0.5 * side.y * dFdy(value) : 0.0);
}

vec3 block_mean(vec3 value, bvec2 sides)
{
    return vec3(block_mean(value.r, sides), block_mean(value.g, sides), block_mean(value.b, sides));
}

float block_mean(float value)
{
    return block_mean(value, bvec2(true));
}
