// The table of objects; contract.py says what each member of a row means.
struct Object { OBJECT_MEMBERS };

layout(std430, binding = OBJECTS_BINDING) readonly buffer Objects { Object objects[]; };
