// What all shaders know about the frame; filled by frame.py.
struct Light {
    vec4 position;   // xyz [m]; w: 1 for a lamp at a place, 0 for one far away
    vec4 direction;  // towards the lamp, or against the beam of a spot; w: cosine of its half angle
    vec4 radiance;   // of a white surface that faces the lamp, times its solid angle over pi; w: exponent of the beam
    vec4 falloff;    // constant, linear [1/m], quadratic [1/m^2]
};

struct Shadow {
    mat4 matrix;    // world -> the lamp's map, all three coordinates 0 to 1 after the division
    mat4 planes;    // its inverse transpose: takes planes along
    vec4 depth;     // (x z + y) / (z z + w) turns a depth of the map into metres from the lamp
    vec4 width;     // x + y times that distance: the map's width [m]; z: its texels
    vec4 penumbra;  // x: tangent of the lamp's radius; y: radius [m] of a near lamp; z: widest in the map
    vec4 floor;     // box about the shadows on the floor, in its occlusion map: lower and upper corner
};

layout(std140, binding = 0) uniform Frame {
    mat4 view_projection;
    vec4 eye;              // xyz [m]; w: distance to the focus [m]
    vec4 focus;            // what the camera is about [m]
    vec4 ray;              // through the middle of the picture, one metre along the camera's axis; w: near plane [m]
    vec4 ray_right;        // from there to the picture's right edge; w: far plane [m]
    vec4 ray_up;
    vec4 zenith;           // radiance of the background overhead
    vec4 horizon;          // and at the horizon
    vec4 sky;              // radiance that lights from above; w: share of the soft boxes in it
    vec4 lamp_normal[3];   // towards the middle of a soft box; w: half its width over its distance
    vec4 lamp_tangent[3];  // its horizontal axis; w: half its height
    vec4 lamp_radiance[3];
    vec4 floor_origin;     // xyz [m]; w: 1 with a floor, 0 without
    vec4 floor_u;          // axes of the floor; w: its half sizes [m]
    vec4 floor_v;
    vec4 floor_normal;
    vec4 floor_albedo;     // mean colour
    vec4 floor_light;      // irradiance of the floor over pi where nothing shades it
    vec4 floor_map;        // occlusion map: xy centre, z half width [m]
    vec4 floor_fade;       // x, y: from where to where, in distances of the focus, it fades into the background
    Light lights[8];       // the first ones cast shadows
    Shadow shadows[4];     // of those
    vec4 counts;           // x: occluders, y: lights, z: number of the exposure, w: lights that cast shadows
};
