#version 410
// Deferred shading of the pixels that show solids, in all or some of their samples: every surface that is visible in a
// pixel is lit once. It reflects light with GGX highlights and Schlick's Fresnel term over a diffuse, translucent base, under
// a clear coat.
#include "glsl/view.glsl"

#stage fragment
#include "glsl/floor_map.glsl"
#include "glsl/fog.glsl"
#include "glsl/g_buffer_samples.glsl"
#include "glsl/height_maps.glsl"
#include "glsl/lights.glsl"
#include "glsl/objects.glsl"
#include "glsl/occluders.glsl"
#include "glsl/soft_shadows.glsl"
#include "glsl/tone_mapping.glsl"

layout(binding = BEHIND_UNIT) uniform sampler2D frame_behind;  // the frame without the transparent object

out vec4 fragment;

const float FULL_LIGHT = 0.70;  // sRGB value of a lit surface from which a heatmap's colour is unchanged
const float DARKEST = 0.45;
const float NEUTRAL = 0.62;     // albedo under a heatmap
const float SCATTER = 0.2;      // depth that light reaches under a translucent surface, in sizes of the object
const float CREASE = 0.35;      // difference of the unit normals of two pixels: a radius of three pixels
const float PIXEL_VARIANCE = 1.0 / 24.0;  // variance of normals in a pixel, over the squares of their steps to the neighbouring pixels
const float MOST_VARIANCE = 0.1;
const vec3 INK = vec3(0.09, 0.11, 0.16);

const float SOFTENED = 0.6;  // greatest share of the ripples' shading that light under the surface takes away
const float COAT_ROUGHNESS = 0.25;  // roughness of a lamp's highlight in the coat: lamps are not points

// Mean radiance of the floor about a point, within a radius [m].
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

// The surface that a sample shows.
struct SurfaceSample {
    int object;
    vec3 normal;   // without ripples
    vec3 rippled;
    vec3 color;    // square root of the albedo
    float ink;     // opacity of lines on top; CLEAR: of the surface; GLOWING: emitted share of the colour
    float visibility, thickness;
    vec2 place;    // on the page of charts [texels]
    bool inner;    // whether the object's inner side is seen
};

#if LAYER
// Colour behind the point where a ray, refracted as in water, leaves the object; blurred where the object is turbid.
vec3 seen_through(vec3 position, vec3 normal, float thickness, float size, float turbidity)
{
    vec3 bent = refract(normalize(position - start), normal, 0.75);
    vec4 exit = view_projection * vec4(position + thickness * size * bent, 1.0);
    vec3 shown = textureLod(frame_behind, 0.5 + 0.5 * exit.xy / exit.w, 6.0 * turbidity).rgb;
    vec3 boxes = environment(bent, 0.1 + 0.5 * turbidity, vec3(0.0)) - environment(bent, 1.0, vec3(0.0));
    return shown + max(boxes, 0.0) * 0.3;
}
#endif

// Radiance of a surface; `spread` is the variance of its normals in the pixel, `block` tells which neighbours in the block
// of 2 x 2 share their shadows with the pixel.
vec3 shaded(Object object, SurfaceSample surface, vec3 albedo, vec3 position, float spread, bvec2 block)
{
    float roughness = object.base.x, metallic = object.base.y, sheen = object.base.z, coat = object.base.w;
    float translucency = object.volume.x, transparency = object.volume.y, emission = object.volume.z;
    float size = object.place.y, bumps = object.place.z;  // that the shading normal accounts for
    vec3 normal = surface.rippled, flat_normal = surface.normal, view = normalize(start - position);
    bool from_behind = object.place.w == BACK_AS_FRONT_SHADING && surface.inner;  // of a sheet that is lit on its front
    normal = from_behind ? -normal : normal;
    flat_normal = from_behind ? -flat_normal : flat_normal;
    // interpolated normals of bumpy silhouettes may look away from the camera
    normal = normalize(normal + (from_behind ? 0.0 : max(0.1 - dot(normal, view), 0.0)) * view);
    vec3 reflected = reflect(-view, normal);
    float n_v = clamp(from_behind ? -dot(normal, view) : dot(normal, view), 0.1, 1.0);

    float open = surface.visibility * occluder_visibility(position, flat_normal, int(object.height_map.z));
    float height = max(dot(position - floor_origin.xyz, floor_normal.xyz), 0.0);
    // a wall sees the floor before it, about as far away as it is high
    vec3 bounce = floor_radiance(position + 1.2 * height * normal, height);
    float rough = roughened(roughness, spread);
    // reflection of the floor: where the coat is a mirror, the base is not, and sees much of the floor
    vec3 met = position + reflected * height / max(-dot(reflected, floor_normal.xyz), 0.2);
    vec3 mirrored = floor_radiance(met, 0.3 * height), blurred_floor = floor_radiance(met, (0.3 + 2.0 * rough) * height);
    vec3 f0 = mix(vec3(0.04), albedo, metallic);

    // in translucent objects light of their own colour wraps round the edges
    vec3 wrap = 0.6 * translucency * albedo;
    // and it gets the further under the surface: shadows have edges of that colour, ripples are softened
    vec3 reach = albedo / max(max(albedo.r, albedo.g), max(albedo.b, 1e-3));
    vec3 blurred = SOFTENED * translucency * reach, sharpness = 1.0 / mix(vec3(1.0), 0.3 + 0.7 * reach, translucency);
    // light that enters elsewhere and leaves here: more of it where the object is thin
    float thin = exp(-4.0 * surface.thickness);
    vec3 shadow[SHADOWS];
    for (int i = 0; i < SHADOWS; ++i)
        shadow[i] = light_arriving(i, position, flat_normal, bumps, SCATTER * translucency * size, block);
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
        direct += radiance * diffuse * mix(lit, vec3(1.0), 0.35 * translucency);
        vec3 arrives = 0.25 * light_at(i).falloff.w * radiance * visible * clamp(n_l * 4.0, 0.0, 1.0);
        float n_h = max(dot(normal, halfway), 0.0), v_h = max(dot(view, halfway), 0.0);
        highlight += arrives * fresnel(f0, v_h) * ggx(n_h, roughness, spread);
        coated += arrives * fresnel(vec3(0.04), v_h) * ggx(n_h, COAT_ROUGHNESS, spread);
        float behind = clamp(0.5 - 0.5 * n_l, 0.0, 1.0);
        glow += radiance * thin * (0.35 + 0.65 * behind * behind);
    }
    vec3 surround = ambient(normal, bounce, shadow[0]) * open;
    surround *= mix(vec3(1.0), reach, 0.8 * translucency);
    // light bounces between coloured walls: occlusion is less deep and more saturated
    surround *= mix(albedo * (1.0 - open) + open, vec3(1.0), open);
    vec3 base = albedo * (direct + surround) * (1.0 - metallic) + translucency * albedo * glow;
    base += emission * albedo;
#if LAYER
    // transparent objects show the objects behind them, refracted, and tinted by their own thickness
    vec3 behind = seen_through(position, surface.rippled, surface.thickness, size, translucency);
    base = mix(base, behind * pow(albedo, vec3(0.15 + 0.8 * surface.thickness)), transparency);
#endif
    base += sheen * albedo * surround * ((1.0 - n_v) * (1.0 - n_v) * (1.0 - n_v));

    float hidden = clamp(open * open + 0.15, 0.0, 1.0);
    vec3 at_edge = f0 + (max(vec3(1.0 - roughness), f0) - f0) * fifth_power(1.0 - n_v);
    vec3 gloss = environment(reflected, rough, blurred_floor) * at_edge * hidden + highlight;
    float film_share = coat * fresnel(vec3(0.04), n_v).x;
    vec3 film = environment(reflected, roughened(0.06, spread), mirrored) * hidden;
    return (base + gloss) * (1.0 - film_share) + film_share * film + coat * coated;
}

SurfaceSample surface_sample(ivec2 pixel, int s)
{
    vec4 normal = texelFetch(normals, pixel, s), color = texelFetch(colors, pixel, s);
    SurfaceSample surface;
    surface.object = unpack_object(normal.z);
    surface.normal = octahedral_decode(normal.xy);
    vec2 red_green = unpack_unorm8(color.z), blue_ink = unpack_unorm8(color.w), baked = unpack_unorm8(normal.w);
    surface.color = vec3(red_green, blue_ink.x);
    surface.ink = blue_ink.y;
    surface.visibility = baked.x;
    surface.thickness = 2.0 * baked.y;
    surface.place = color.xy * vec2(textureSize(height_maps, 0).xy);
    surface.inner = unpack_inner(normal.z);
    return surface;
}

// Whether the neighbours in the block of 2 x 2 pixels, to the side and above or below, show the same object as near.
bvec2 same_beside(SurfaceSample surface, float at)
{
    float object = float(surface.object);
    return bvec2(dFdx(object) == 0.0 && abs(dFdx(at)) < 0.02 * at, dFdy(object) == 0.0 && abs(dFdy(at)) < 0.02 * at);
}

// Adds the ripples to a surface; returns the variance of its normals in the pixel, as far as neighbours that are the
// `same` tell, which widens highlights (geometric specular antialiasing: Kaplanyan, Hill, Patney and Lefohn, Filtering
// distributions of normals for shading antialiasing, 2016). Creases do not count: both of their sides are sharp.
float rippled(inout SurfaceSample surface, bvec2 same)
{
    Object object = object_at(surface.object);
    vec2 chart = floor(surface.place / max(object.height_map.w, 1.0));
    bvec2 near = bvec2(same.x && dFdx(chart) == vec2(0.0), same.y && dFdy(chart) == vec2(0.0));
    vec2 across = near.x ? dFdx(surface.place) : vec2(0.0), up = near.y ? dFdy(surface.place) : vec2(0.0);
    float variance;
    vec4 ripple = seen_at(vec3(surface.place, object.height_map.x), across, up, vec3(chart, 1.0) * object.height_map.w,
                          variance) * (surface.inner ? -1.0 : 1.0);
    surface.rippled = normalize(surface.normal - object.rotation * ripple.xyz);
    // cavity occlusion: less light reaches the troughs
    surface.visibility *= 1.0 - 0.4 * smoothstep(0.0, 0.03, -ripple.w / object.place.y);
    vec3 right = dFdx(surface.rippled), above = dFdy(surface.rippled);
    bool smooth_across = same.x && length(dFdx(surface.normal)) < CREASE;
    bool smooth_up = same.y && length(dFdy(surface.normal)) < CREASE;
    float between = (smooth_across ? dot(right, right) : 0.0) + (smooth_up ? dot(above, above) : 0.0);
    return min(max(PIXEL_VARIANCE * between, variance), MOST_VARIANCE);
}

// Colour and opacity; see `shaded`.
vec4 lit_solid(SurfaceSample surface, vec3 position, float spread, bvec2 block)
{
    Object object = object_at(surface.object);
    bool heatmap = object.place.w == HEATMAP_SHADING, unlit = object.place.w == UNLIT_SHADING;
    vec3 albedo = heatmap ? vec3(NEUTRAL) : surface.color * surface.color;
    float emitted = object.place.w == GLOWING_SHADING ? surface.ink : 0.0;  // share of the colour
    // of all, for neighbours take shadows over
    vec3 radiance = shaded(object, surface, (1.0 - emitted) * albedo, position, spread, block) + emitted * albedo;
    vec3 shown = unlit ? encoded(albedo) : tone_mapped(radiance);
    if (object.place.w == CLEAR_SHADING)
        return vec4(shown, surface.ink);
    if (object.place.w == GLOWING_SHADING)
        return vec4(shown, object.volume.w);
    float shade = clamp(dot(shown, vec3(0.2126, 0.7152, 0.0722)) / FULL_LIGHT, DARKEST, 1.0);
    return vec4(mix(heatmap ? surface.color * shade : shown, INK, surface.ink), object.volume.w);
}

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int left = visible_samples(pixel);
    vec4 sum = vec4(0.0);
    float spread = 0.0, count = float(bitCount(left));
    // pixels that show as many samples belong to the same pass; derivatives across others are undefined
    bvec2 block = bvec2(block_inside(pixel) && dFdx(count) == 0.0, block_inside(pixel) && dFdy(count) == 0.0);
    bool again = false;
    do {
        int first = max(findLSB(left), 0), alike = 1 << first;
        float at = eye_distance(texelFetch(depths, pixel, first).r);
        SurfaceSample surface = surface_sample(pixel, first);
        bvec2 same = same_beside(surface, left == 0 ? -1.0 : at);
        float variance = rippled(surface, bvec2(same.x && !again, same.y && !again));
        spread = again ? spread : variance;
        block = bvec2(block.x && same.x && !again, block.y && same.y && !again);
        // samples of the same surface share their light
        vec3 own = texelFetch(normals, pixel, first).xyz;
        for (int s = 1; s < SAMPLES; ++s) {
            vec3 other = texelFetch(normals, pixel, s).xyz;
            bool near = abs(eye_distance(texelFetch(depths, pixel, s).r) - at) < 0.01 * at;
            alike |= near && other.z == own.z && distance(other.xy, own.xy) < 0.06 ? 1 << s : 0;
        }
        alike &= left;
        left &= ~alike;
        vec4 color = lit_solid(surface, start + at * way, spread, block);
#if !BACKDROP
        color.rgb = fogged(color.rgb, at);
#endif
        sum += float(bitCount(alike)) / float(SAMPLES) * vec4(dithered(color.rgb) * color.a, color.a);
        again = true;
    } while (left != 0);
    fragment = sum;
}
