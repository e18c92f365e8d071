// What all shaders know about the frame; filled by frame.py.
layout(std140, binding = 0) uniform Frame {
    mat4 view_projection;
    mat4 shadow_matrix;    // world -> shadow map, all three coordinates 0 to 1
    vec4 eye;              // xyz [m]; w: distance to the focus [m]
    vec4 focus;            // what the camera is about [m]
    vec4 key_direction;    // towards the lamp; w: tangent of its angular radius
    vec4 key_radiance;     // of a white surface that faces the lamp
    vec4 shadow_scale;     // x: width [m], y: depth [m], z: texel [m]
    vec4 zenith;           // radiance of the background overhead
    vec4 horizon;          // and at the horizon
    vec4 lamp_normal[3];   // towards the middle of a soft box; w: half its width over its distance
    vec4 lamp_tangent[3];  // its horizontal axis; w: half its height
    vec4 lamp_radiance[3];
    vec4 floor_origin;     // xyz [m]; w: 1 with a floor, 0 without
    vec4 floor_u;          // axes of the floor
    vec4 floor_v;
    vec4 floor_normal;
    vec4 floor_albedo;     // mean colour
    vec4 floor_map;        // occlusion map: xy centre, z half width [m]
    vec4 counts;           // x: occluders
};
