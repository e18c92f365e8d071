// The shaders of what is drawn, which are files of their own. `light`, `lit` and `floor` are the
// parts of light_shaders.js, which depend on the scene's lamps.
const COLOR = 4; // the attribute of vertices with a colour of their own

const EVERYWHERE_VERTEX = shaderOf("everywhere.vert");
const SURFACE_VERTEX = shaderOf("surface.vert");
const LIT_POINTS_VERTEX = shaderOf("lit_points.vert");
const LIT_POINTS_FRAGMENT = shaderOf("lit_points.frag");
const DEPTH_VERTEX = shaderOf("depth.vert");
const DEPTH_FRAGMENT = shaderOf("depth.frag");
const SHADE_FRAGMENT = shaderOf("shade.frag");

const surfaceFragment = (light, lit) => light + lit + shaderOf("surface.frag");
const pointsFragment = (light, lit) => light + lit + shaderOf("points.frag");
const floorVertex = (light, floor) => light + floor + shaderOf("floor.vert");
const floorFragment = (light, floor) => light + floor + shaderOf("floor.frag");
const skyFragment = light => light + shaderOf("sky.frag");
