// The height maps of all targets: gradient (xyz) and height (w), a page of charts each.
#include "surfaces/spline.glsl"

layout(binding = HEIGHT_MAPS_UNIT) uniform sampler2DArray height_maps;
