// MuJoCo's fog, without a backdrop: solids and the floor take on its colour with their distance along the camera's axis.
#include "glsl/frame.glsl"

// A colour of the frame, seen at a distance [m].
vec3 fogged(vec3 shown, float at)
{
    float share = clamp((at - shown_far.x) / max(shown_far.y - shown_far.x, 1e-6), 0.0, 1.0);
    return mix(shown, fog.rgb, fog.w * share);
}
