// Points spread evenly over a disc.
const float TWO_PI = 6.2831853;

// Points at growing radii that follow one another under turns by the golden angle spread evenly (Vogel's spiral).
const float GOLDEN_ANGLE = 2.3999632;
const mat2 GOLDEN_TURN = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888);
const mat2 FOURTH_TURN = mat2(-0.98471349, -0.17418195, 0.17418195, -0.98471349);  // by four times that

// Number, and a half, of this pixel's first point of a spiral, of whose points the pixels of a block of 2 x 2 take turns:
// every block has the same, so that there is neither noise nor hatching.
float first_point()
{
    ivec2 corner = ivec2(gl_FragCoord.xy) & 1;
    return float(corner.x + 2 * corner.y) + 0.5;
}

vec2 spiral_direction(float point)
{
    return vec2(cos(GOLDEN_ANGLE * point), sin(GOLDEN_ANGLE * point));
}
