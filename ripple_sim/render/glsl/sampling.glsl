// Places of samples: blocks of 2 x 2 pixels that share their work, and points of a disc.

// Mean over a block of 2 x 2 pixels, or over the part of the block to some sides of the pixel.
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

const float TWO_PI = 6.2831853;

// Points of a spiral spread evenly if each is turned by the golden angle from the one before (Vogel's spiral).
const float GOLDEN_ANGLE = 2.3999632;
const mat2 GOLDEN_TURN = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888);
const mat2 FOURTH_TURN = mat2(-0.98471349, -0.17418195, 0.17418195, -0.98471349);  // by four times that

// Number of this pixel's first point of a spiral, plus a half. The pixels of a block of 2 x 2 take the points in turn. Every
// block has the same points, so that there is neither noise nor hatching.
float first_point()
{
    ivec2 corner = ivec2(gl_FragCoord.xy) & 1;
    return float(corner.x + 2 * corner.y) + 0.5;
}

vec2 spiral_direction(float point)
{
    return vec2(cos(GOLDEN_ANGLE * point), sin(GOLDEN_ANGLE * point));
}

// Means over parts of a disc, in place of points of the disc: one in the middle and the others on a circle about it. A
// blocker that covers half of the disc is found with an error of at most 0.018, and small blockers count evenly. As many
// means on a spiral, which do not balance about the middle, have an error of 0.06.
const int MEANS = 8;
const float CIRCLE_RADIUS = 0.8, MEAN_WIDTH = 0.5;  // in radii of the disc
const mat2 CIRCLE_TURN = mat2(0.62348980, 0.78183148, -0.78183148, 0.62348980);  // by a seventh

// Distance of a mean from the middle of the disc, in radii of the disc.
float mean_radius(int number)
{
    return number == 0 ? 0.0 : CIRCLE_RADIUS;
}
