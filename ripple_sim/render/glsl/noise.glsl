// Interleaved gradient noise, 0 to 1: evenly spread over any few neighbouring pixels.
float gradient_noise(vec2 pixel)
{
    return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))));
}
