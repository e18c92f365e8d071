// The background at a fraction of the frame's resolution; see background.py.
layout(binding = COARSE_BACKGROUND_UNIT) uniform sampler2D coarse;  // a: 1 for floor, 0 for sky, between them where rough
