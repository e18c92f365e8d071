// How a solid surface reflects light: GGX highlights with Schlick's Fresnel term over a diffuse, translucent base, under
// a clear coat.
#include "glsl/floor_map.glsl"
#include "glsl/lights.glsl"
#include "glsl/occluders.glsl"
#include "glsl/soft_shadows.glsl"

struct Material {
    vec3 albedo;
    float roughness, metallic, sheen, coat, translucency, transparency, emission;
    float thickness;    // of the object under the surface, 0 to about 1
    vec3 behind;        // radiance of what is seen through the object
    float shadow_bias;  // height of bumps that the shading normal accounts for [m]
    float scatter;      // how far light gets under the surface [m]
    float visibility;   // ambient visibility that the object itself leaves, and its neighbours where `occluders` is 0
    int occluders;      // bits of those that count
    bvec2 block;        // neighbours in the block of 2 x 2 pixels that share their shadows with this one
};

const float SOFTENED = 0.6;  // most of the ripples' shading that light under the surface takes away
const float COAT_ROUGHNESS = 0.25;  // of a lamp's highlight: lamps are not points

// Radiance of the floor about a point of it, as far as the radius [m].
vec3 floor_radiance(vec3 position, float radius)
{
    vec3 local = position - floor_origin.xyz;
    vec2 place = floor_map_position(vec2(dot(local, floor_u.xyz), dot(local, floor_v.xyz)));
    float texel = 2.0 * floor_map.z / float(textureSize(floor_seen, 0).x);
    vec2 open = textureLod(floor_seen, place, log2(max(radius / texel, 2.0))).rg;
    vec3 lit = floor_lit * open.g + floor_surround * (0.15 + 0.85 * open.r);
    return floor_origin.w > 0.0 ? lit : sky.rgb * 0.8;
}

// Of a roughness, on a surface whose normals have a variance in the pixel.
float ggx(float n_h, float roughness, float variance)
{
    // narrower highlights would flicker
    float a2 = clamp(roughness * roughness * roughness * roughness + variance, 1.6e-5, 1.0);
    float d = n_h * n_h * (a2 - 1.0) + 1.0;
    return a2 / (d * d);
}

float fifth_power(float x)
{
    return x * x * (x * x) * x;
}

vec3 fresnel(vec3 f0, float cosine)
{
    return f0 + (1.0 - f0) * fifth_power(max(1.0 - cosine, 0.0));
}

vec3 shaded(Material m, vec3 position, vec3 normal, vec3 flat_normal, float own_geom, float spread)
{
    vec3 view = normalize(eye.xyz - position);
    // interpolated normals of bumpy silhouettes may look away from the camera
    normal = normalize(normal + max(0.1 - dot(normal, view), 0.0) * view);
    vec3 reflected = reflect(-view, normal);
    float n_v = clamp(dot(normal, view), 0.1, 1.0);

    float open = m.visibility * occluder_visibility(position, flat_normal, m.occluders);
    float height = max(dot(position - floor_origin.xyz, floor_normal.xyz), 0.0);
    // a wall sees the floor before it, about as far away as it is high
    vec3 bounce = floor_radiance(position + 1.2 * height * normal, height);
    float rough = roughened(m.roughness, spread);
    // what is reflected of the floor: where the coat is a mirror, the base is not, and sees much of it
    vec3 met = position + reflected * height / max(-dot(reflected, floor_normal.xyz), 0.2);
    vec3 mirrored = floor_radiance(met, 0.3 * height), blurred_floor = floor_radiance(met, (0.3 + 2.0 * rough) * height);
    vec3 f0 = mix(vec3(0.04), m.albedo, m.metallic);

    // in translucent objects light of their own colour wraps round the edges
    vec3 wrap = 0.6 * m.translucency * m.albedo;
    // and it gets the further under the surface: shadows have edges of that colour, ripples are softened
    vec3 reach = m.albedo / max(max(m.albedo.r, m.albedo.g), max(m.albedo.b, 1e-3));
    vec3 blurred = SOFTENED * m.translucency * reach, sharpness = 1.0 / mix(vec3(1.0), 0.3 + 0.7 * reach, m.translucency);
    // light that enters elsewhere and leaves here: more of it where the object is thin
    float thin = exp(-4.0 * m.thickness);
    vec3 shadow[SHADOWS];
    for (int i = 0; i < SHADOWS; ++i)
        shadow[i] = light_arriving(i, position, flat_normal, m.shadow_bias, m.scatter, m.block);
    vec3 direct = vec3(0.0), highlight = vec3(0.0), coated = vec3(0.0), glow = vec3(0.0);
    for (int i = 0; i < LIGHTS; ++i) {
        vec3 light;
        vec3 radiance = incident(light_at(i), position, light);
        float n_l = dot(normal, light);
        vec3 visible = i < SHADOWS ? shadow[i] : vec3(1.0);
        vec3 halfway = normalize(view + light);
        vec3 facing = mix(vec3(n_l), vec3(dot(flat_normal, light)), blurred);
        vec3 diffuse = max(facing + wrap, 0.0) / ((1.0 + wrap) * (1.0 + wrap));
        vec3 lit = clamp((visible - 0.5) * sharpness + 0.5, 0.0, 1.0);
        direct += radiance * diffuse * mix(lit, vec3(1.0), 0.35 * m.translucency);
        vec3 arrives = 0.25 * radiance * visible * clamp(n_l * 4.0, 0.0, 1.0);
        float n_h = max(dot(normal, halfway), 0.0), v_h = max(dot(view, halfway), 0.0);
        highlight += arrives * fresnel(f0, v_h) * ggx(n_h, m.roughness, spread);
        coated += arrives * fresnel(vec3(0.04), v_h) * ggx(n_h, COAT_ROUGHNESS, spread);
        float behind = clamp(0.5 - 0.5 * n_l, 0.0, 1.0);
        glow += radiance * thin * (0.35 + 0.65 * behind * behind);
    }
    vec3 surround = ambient(normal, bounce, shadow[0]) * open;
    surround *= mix(vec3(1.0), reach, 0.8 * m.translucency);
    // light bounces between coloured walls: occlusion is less deep and more saturated
    surround *= mix(m.albedo * (1.0 - open) + open, vec3(1.0), open);
    vec3 base = m.albedo * (direct + surround) * (1.0 - m.metallic) + m.translucency * m.albedo * glow;
    base += m.emission * m.albedo;
#if LAYER
    // transparent objects show what is behind them, refracted, and tinted by their thickness
    base = mix(base, m.behind * pow(m.albedo, vec3(0.15 + 0.8 * m.thickness)), m.transparency);
#endif
    base += m.sheen * m.albedo * surround * ((1.0 - n_v) * (1.0 - n_v) * (1.0 - n_v));

    float hidden = clamp(open * open + 0.15, 0.0, 1.0);
    vec3 at_edge = f0 + (max(vec3(1.0 - m.roughness), f0) - f0) * fifth_power(1.0 - n_v);
    vec3 gloss = environment(reflected, rough, blurred_floor) * at_edge * hidden + highlight;
    float coat = m.coat * fresnel(vec3(0.04), n_v).x;
    vec3 film = environment(reflected, roughened(0.06, spread), mirrored) * hidden;
    return (base + gloss) * (1.0 - coat) + coat * film + m.coat * coated;
}
