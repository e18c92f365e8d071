// What all shaders know about the frame; contract.py says what each member means.
struct Light { LIGHT_MEMBERS };

struct Shadow { SHADOW_MEMBERS };

layout(std140, binding = FRAME_BINDING) uniform Frame { FRAME_MEMBERS };
