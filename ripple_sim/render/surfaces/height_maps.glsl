// The height maps of all targets: gradient (xyz) and height (w), six layers each, with a halo.
#include "surfaces/spline.glsl"

layout(binding = HEIGHT_MAPS_UNIT) uniform sampler2DArray height_maps;
