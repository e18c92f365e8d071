// Points spread evenly over a disc.
const float TWO_PI = 6.2831853;

// A turn by the golden angle: points at growing radii that follow one another under it spread evenly (Vogel's spiral).
const mat2 GOLDEN_TURN = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888);
