// Eight floats as the bits of four doubles: a software driver pays for every load and store, whatever its width.
float[8] unpack(dvec4 x) {
    vec2 a = uintBitsToFloat(unpackDouble2x32(x.x)), b = uintBitsToFloat(unpackDouble2x32(x.y));
    vec2 c = uintBitsToFloat(unpackDouble2x32(x.z)), d = uintBitsToFloat(unpackDouble2x32(x.w));
    return float[8](a.x, a.y, b.x, b.y, c.x, c.y, d.x, d.y);
}

double pair(float x, float y) {
    return packDouble2x32(floatBitsToUint(vec2(x, y)));
}

dvec4 pack(float x[8]) {
    return dvec4(pair(x[0], x[1]), pair(x[2], x[3]), pair(x[4], x[5]), pair(x[6], x[7]));
}
