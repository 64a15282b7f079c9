"""GLSL programs of the eye. Light is linear inside; pictures hold its square root.

`id` is the thing's number for the label pass: 0 sky, 1 water, 2 land, 3 and up the world's things.
"""

_COMMON = """
#version 330
uniform vec3 eye; uniform vec3 sun; uniform vec3 sunRgb; uniform vec3 skyRgb; uniform vec3 hazeRgb;
uniform float visibility; uniform float exposure; uniform float time; uniform float flip;
uniform sampler2D noiseTile; uniform sampler2D panorama;
const float PI = 3.14159265;
vec3 encode(vec3 light) {
    vec3 x = light * exposure;
    vec3 film = (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);
    return sqrt(clamp(film, 0.0, 1.0));
}
vec3 skyLight(vec3 ray, float lod) {
    vec2 uv = vec2(atan(ray.y, ray.x) / (2.0 * PI) + time * 0.00015, sqrt(max(ray.z, 0.0)));
    vec3 c = textureLod(panorama, vec2(uv.x, clamp(uv.y, 0.004, 0.99)), lod).rgb;
    return c * c;
}
float haze(float distance) { return 1.0 - exp(-distance / visibility); }
vec3 hazeLight(vec3 ray) {
    return mix(hazeRgb, skyLight(normalize(vec3(ray.xy, 0.03)), 5.0), 0.6) * 0.92;
}
// What the mirrored pass keeps in alpha: how far away the reflected thing is, 0 for the sky.
float nearness(float distance) { return flip < 0.0 ? 0.25 + 0.75 * exp(-distance / 60.0) : 1.0; }
"""

SOLID_VERTEX = (
    _COMMON
    + """
layout(location = 0) in vec3 position; layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 paint; layout(location = 3) in float number;
uniform mat4 clipFromMap; uniform mat4 mapFromModel;
out vec3 world; out vec3 place; out vec3 facing; out vec3 tint; out vec3 hazeTint;
flat out int kind; flat out float id;
void main() {
    vec4 p = mapFromModel * vec4(position, 1.0);
    world = p.xyz; place = position; facing = mat3(mapFromModel) * normal; tint = paint.rgb * paint.rgb;
    kind = int(paint.a + 0.5); id = number;
    hazeTint = hazeLight(p.xyz - eye);
    gl_ClipDistance[0] = flip < 0.0 ? p.z : 1.0;
    gl_Position = clipFromMap * vec4(p.xy, p.z * flip, 1.0);
}
"""
)

# The software rasteriser runs every branch, so the surfaces share two samples.
SOLID_FRAGMENT = (
    _COMMON
    + """
in vec3 world; in vec3 place; in vec3 facing; in vec3 tint; in vec3 hazeTint;
flat in int kind; flat in float id;
uniform sampler2DArray surfaces; uniform vec3 tilesPerMetre;
layout(location = 0) out vec4 colour; layout(location = 1) out vec4 label;
void main() {
    vec3 toEye = eye - world; float range = length(toEye);
    vec3 n = normalize(facing), v = toEye / range;
    if (dot(n, vec3(v.xy, v.z * flip)) < 0.0) n = -n;
    bool land = kind == 1, wood = kind == 2, rock = kind == 3, glass = kind == 4, facade = kind == 5;
    bool laid = kind >= 6;
    float across = place.x + 0.8 * place.y;
    vec2 wall = vec2(abs(n.x) > abs(n.y) ? place.y : place.x, place.z);
    vec2 course = abs(n.z) > 0.7 ? place.xy : vec2(dot(place.xy, normalize(vec2(-n.y, n.x))), place.z);
    vec2 wide = land ? place.xy * 0.021 : wood ? vec2(across, place.z * 4.0) * 0.9
        : facade ? wall * 0.1 : laid ? course * tilesPerMetre[kind - 6] : vec2(across, place.z) * 0.5;
    vec2 fine = land ? place.xy * 0.17 : laid ? course * 0.07 : vec2(across, place.z) * 0.23;
    vec4 a = texture(surfaces, vec3(wide, laid ? float(kind - 5) : 0.0)), b = texture(noiseTile, fine);
    float stain = land ? 0.35 + 0.55 * a.g + 0.6 * b.b + 0.35 * b.r + 0.5 * (b.a - 0.5)
        : wood ? 0.55 + 0.9 * a.b
        : rock ? (0.45 + 0.6 * b.g + 0.5 * b.b) * mix(0.45, 1.0, smoothstep(0.05, 0.55, world.z))
        : laid ? 2.0 * a.g * (0.62 + 0.5 * b.g + 0.26 * b.r) : 0.84 + 0.32 * a.g;
    vec2 cell = fract(wall * vec2(0.42, 0.38));
    bool pane = facade && abs(cell.x - 0.5) < 0.2 && abs(cell.y - 0.55) < 0.24 && abs(n.z) < 0.5;
    vec3 dry = mix(vec3(1.0), vec3(1.35, 1.08, 0.7), land ? clamp(a.r * 2.0 - 0.9, 0.0, 1.0) : 0.0);
    vec3 albedo = pane ? vec3(0.02, 0.025, 0.03) : tint * stain * dry;
    float slime = laid ? 1.0 - smoothstep(0.10, 0.34, world.z - 0.35 * (b.b - 0.5)) : 0.0;
    albedo = mix(albedo, vec3(0.030, 0.042, 0.016) * (0.5 + a.g), 0.85 * slime);
    n = land ? normalize(n + vec3(b.b - 0.5, b.g - 0.5, 0.0) * 1.1) : n;
    albedo *= mix(0.55, 1.0, smoothstep(-0.02, 0.14, world.z));
    float direct = max(dot(n, sun), 0.0);
    vec3 light = sunRgb * direct + skyRgb * (0.62 + 0.38 * n.z) + 0.10 * sunRgb * (0.5 - 0.5 * n.z);
    vec3 shade = albedo * light;
    float gloss = glass ? 0.45 : pane ? 0.35 : land || wood || rock || laid ? 0.0 : 0.05;
    vec3 mirrored = reflect(-v, n);
    float edge = gloss + gloss * 4.0 * pow(1.0 - max(dot(n, v), 0.0), 5.0);
    shade += edge * mix(hazeTint, skyRgb, clamp(abs(mirrored.z) * 1.5, 0.0, 1.0)) * 0.8;
    shade += gloss * sunRgb * pow(max(dot(mirrored, sun), 0.0), 60.0) * 3.0;
    shade = mix(shade, hazeTint, haze(range));
    colour = vec4(encode(shade), nearness(range));
    label = vec4(mod(id, 256.0) / 255.0, floor(id / 256.0) / 255.0, 0.0, 1.0);
}
"""
)

PLANT_VERTEX = (
    _COMMON
    + """
layout(location = 0) in vec3 foot; layout(location = 1) in vec4 card;
layout(location = 2) in vec2 corner;
uniform mat4 clipFromMap;
out vec3 texel; out vec3 light; out vec4 air;
void main() {
    vec2 away = foot.xy - eye.xy;
    vec2 across = normalize(vec2(away.y, -away.x));
    bool mirror = fract(foot.x * 7.31 + foot.y * 3.77) > 0.5;
    float sway = 0.012 * card.y * corner.y * sin(time * 1.3 + foot.x * 0.7 + foot.y * 0.9);
    vec3 world = foot + vec3(across * ((corner.x - 0.5) * card.x + sway), corner.y * card.y);
    texel = vec3(mirror ? 1.0 - corner.x : corner.x, 1.0 - corner.y, card.z);
    float hue = fract(foot.x * 3.17 + foot.y * 5.71);
    vec3 shade = card.w * mix(vec3(1.12, 1.0, 0.82), vec3(0.84, 0.98, 1.0), hue);
    float facing = 0.5 - 0.5 * dot(normalize(away), normalize(sun.xy + 1e-4));
    float lift = 0.40 + 0.60 * corner.y;
    light = 1.45 * shade * (sunRgb * (0.18 + 0.42 * facing) * lift + skyRgb * (0.35 + 0.55 * lift));
    air = vec4(hazeLight(world - eye), distance(world, eye));
    gl_ClipDistance[0] = flip < 0.0 ? world.z : 1.0;
    gl_Position = clipFromMap * vec4(world.xy, world.z * flip, 1.0);
}
"""
)

PLANT_FRAGMENT = (
    _COMMON
    + """
in vec3 texel; in vec3 light; in vec4 air;
uniform sampler2DArray sprites;
layout(location = 0) out vec4 colour; layout(location = 1) out vec4 label;
void main() {
    vec4 leaf = texture(sprites, texel);
    if (leaf.a < 0.42) discard;
    vec3 lit = mix(leaf.rgb * leaf.rgb * light, air.rgb, haze(air.a));
    colour = vec4(encode(lit), nearness(air.a));
    label = vec4(2.0 / 255.0, 0.0, 0.0, 1.0);
}
"""
)

SCREEN_VERTEX = """
#version 330
layout(location = 0) in vec2 corner;
uniform mat4 mapFromClip; uniform vec3 eye;
out vec3 ray;
void main() {
    vec4 far = mapFromClip * vec4(corner, 0.9, 1.0);
    ray = far.xyz / far.w - eye;
    gl_Position = vec4(corner, 1.0, 1.0);
}
"""

SKY_FRAGMENT = (
    _COMMON
    + """
in vec3 ray;
layout(location = 0) out vec4 colour; layout(location = 1) out vec4 label;
void main() {
    vec3 r = normalize(ray);
    vec3 light = skyLight(vec3(r.xy, max(r.z, 0.0)), 0.0);
    float toward = max(dot(r, sun), 0.0);
    light += sunRgb * (3.0 * smoothstep(0.99985, 0.99995, toward) + 0.15 * pow(toward, 400.0));
    light = mix(light, hazeLight(r), exp(-max(r.z, 0.0) * visibility * 0.03) * 0.6);
    colour = vec4(encode(light), 1.0);
    label = vec4(0.0, 0.0, 0.0, 1.0);
}
"""
)

PATCH_VERTEX = (
    _COMMON
    + """
layout(location = 0) in vec3 place; layout(location = 1) in vec2 corner;
layout(location = 2) in vec4 numbers; layout(location = 3) in vec2 toward;
uniform mat4 clipFromMap;
out vec2 at; out float clear; out vec4 what; out vec2 way;
void main() {
    at = corner; what = numbers; way = toward;
    clear = 1.0 - haze(distance(place, eye));
    gl_Position = clipFromMap * vec4(place, 1.0);
}
"""
)

# What the water shader reads of wakes and shadows: slope, foam, shade.
STIR_FRAGMENT = """
#version 330
in vec2 at; in vec4 what; in vec2 way;
layout(location = 0) out vec4 stir;
void main() {
    float dark = what.y * (1.0 - smoothstep(0.35, 1.0, length(at)));
    float behind = at.x, aside = abs(at.y), side = sign(at.y), beam = what.z;
    float arm = 0.6 * beam + 0.354 * behind, width = 0.20 + 0.06 * behind;
    float edge = exp(-pow((aside - arm) / width, 2.0)) * exp(-behind / 13.0) * smoothstep(0.0, 0.6, behind);
    float phase = 1.5 * what.x * (0.58 * behind + 0.81 * aside);
    float inside = (1.0 - smoothstep(0.3 * arm, arm, aside)) * exp(-behind / 9.0);
    float seen = 1.0 - smoothstep(1.2, 3.5, fwidth(phase));
    float apart = edge * cos(phase) * seen, across = 0.45 * inside * cos(what.x * behind) * seen;
    vec2 bent = what.y * (apart * vec2(0.58, 0.81 * side) + vec2(across, 0.0));
    vec2 slope = -bent.x * way + bent.y * vec2(-way.y, way.x);
    float churn = exp(-pow(aside / (0.9 * beam + 0.02 * behind), 2.0)) * exp(-behind / 7.0);
    float foam = what.y * (3.0 * churn + 2.6 * edge * exp(-behind / 1.6) + 0.25 * edge);
    stir = what.w > 0.5 ? vec4(slope, foam, 0.0) : vec4(0.0, 0.0, 0.0, dark);
}
"""

SHADE_FRAGMENT = """
#version 330
in vec2 at; in float clear; in vec4 what;
layout(location = 0) out vec4 colour;
uniform float sunShare;
void main() {
    float dark = what.y * (1.0 - smoothstep(0.25, 1.0, length(at))) * (0.35 + 0.65 * sunShare) * clear;
    colour = vec4(0.0, 0.0, 0.0, 0.55 * dark);
}
"""

WATER_VERTEX = """
#version 330
layout(location = 0) in vec2 corner;
uniform mat4 clipFromMap; uniform vec3 eye;
out vec3 world;
void main() {
    world = vec3(eye.xy + corner * 1500.0, 0.0);
    gl_Position = clipFromMap * vec4(world, 1.0);
}
"""

WATER_FRAGMENT = (
    _COMMON
    + """
in vec3 world;
uniform sampler2D slopes; uniform sampler2D mirrorView; uniform sampler2D stirred;
uniform vec3 swellShare; uniform float sunShare;
uniform mat4 clipFromMap; uniform vec2 screen; uniform vec2 windWay; uniform float slopeRms;
uniform vec2 flow; uniform vec3 bodyRgb;
layout(location = 0) out vec4 colour; layout(location = 1) out vec4 label;
vec4 swell(vec2 p, float tile, float turn, float speed) {
    vec2 way = mat2(cos(turn), sin(turn), -sin(turn), cos(turn)) * windWay;
    mat2 toTile = mat2(way.x, -way.y, way.y, way.x);
    vec4 s = texture(slopes, (toTile * p - vec2(speed * time, 0.0)) / tile);
    vec2 steep = (s.xy - 0.5) * 8.0;
    vec2 slope = transpose(toTile) * steep;
    vec2 rough = max(s.zw * 16.0 - steep * steep, 0.0);
    return vec4(slope, rough);
}
void main() {
    vec3 toEye = eye - world; float range = length(toEye);
    vec3 v = toEye / range;
    vec2 p = world.xy - flow * time;
    vec2 patchNoise = texture(noiseTile, p * 0.006 + time * 0.0006 * windWay).rg;
    float gust = clamp(0.35 + 1.5 * (patchNoise.r - 0.30) + 0.5 * (patchNoise.g - 0.5), 0.15, 1.7);
    float rms = slopeRms * gust;
    vec4 a = swell(p, 11.3, 0.3, 0.9), b = swell(p, 4.1, -0.5, 0.55), c = swell(p, 1.37, 0.9, 0.35);
    vec2 here = gl_FragCoord.xy / screen;
    vec4 stir = texture(stirred, here);
    vec3 part = swellShare * rms;
    vec2 slope = a.xy * part.x + b.xy * part.y + c.xy * part.z + stir.xy;
    vec2 rough = a.zw * part.x * part.x + b.zw * part.y * part.y + c.zw * part.z * part.z;
    float variance = 0.5 * (rough.x + rough.y) + 1e-5;
    float sigma = sqrt(variance);

    vec2 ahead = normalize(v.xy + 1e-6);
    slope += ahead * min(0.75 * sigma, 0.9 * sigma * sigma / (sigma + v.z) + 0.35 * sigma);
    vec3 n = normalize(vec3(-slope, 1.0));
    float facing = dot(n, v);
    if (facing < 0.02) { n = normalize(n + v * (0.03 - facing)); facing = dot(n, v); }
    vec3 r = reflect(-v, n);
    r.z = max(abs(r.z), 0.004);
    r = normalize(r);
    float graze = 1.0 - clamp(facing, 0.0, 1.0);
    float fresnel = 0.02 + 0.98 * graze * graze * graze * graze * graze
        / (1.0 + 22.7 * sigma * sqrt(sigma));

    float near = textureLod(mirrorView, here, 1.0).a;
    float reach = max(-60.0 * log(clamp((near - 0.25) / 0.75, 0.3, 1.0)) - range, 0.4);
    vec3 sky = skyLight(r, clamp(2.0 + 14.0 * sigma, 1.0, 5.0));
    float lod = clamp(log2(1.0 + 90.0 * sigma) - 1.0, 0.0, 2.0);
    vec3 at = (clipFromMap * vec4(world, 1.0)).xyw;
    vec3 level = reach * (clipFromMap * vec4(r.xy, 0.0, 0.0)).xyw, down = -reach * clipFromMap[2].xyw;
    float flat2 = dot(r.xy, r.xy);
    vec3 mirrored = vec3(0.0);
    for (int k = 0; k < 3; k++) {
        float rise = max(r.z + (float(k) - 1.0) * 1.6 * sigma, 0.004);
        vec3 clip = at + (level + rise * down) * inversesqrt(flat2 + rise * rise);
        vec2 uv = clamp(clip.xy / max(clip.z, 0.01) * 0.5 + 0.5, 0.002, 0.998);
        vec4 hit = textureLod(mirrorView, uv, lod);
        float solid = smoothstep(0.02, 0.22, hit.a);
        mirrored += mix(sky, hit.rgb * hit.rgb, solid) / 3.0;
    }
    float shore = 0.85 + 0.3 * texture(noiseTile, p * 0.05).g;
    float lit = 1.0 - min(stir.w, 0.9) * (0.35 + 0.65 * sunShare);
    vec3 body = bodyRgb * shore * lit * (0.35 * sunRgb * max(sun.z, 0.0) + 0.8 * skyRgb);
    vec3 light = mix(body, mirrored, fresnel);

    vec3 h = normalize(sun + v);
    vec2 tilt = h.xy / h.z + slope;
    float spread = variance + 0.0006;
    float glint = exp(-dot(tilt, tilt) / (2.0 * spread)) / (2.0 * PI * spread);
    light += sunRgb * min(glint * 0.02 / max(4.0 * facing, 0.2), 3.0) * step(0.0, dot(v, h)) * lit;
    float froth = texture(noiseTile, p * 0.9).b;
    float crest = patchNoise.g + 0.35 * (c.x * 0.1 + froth);
    float foam = smoothstep(0.72, 0.9, crest) * smoothstep(0.15, 0.24, slopeRms);
    foam = min(foam + 1.6 * stir.z * smoothstep(0.35, 0.75, froth + 0.5 * stir.z), 2.0);
    light = mix(light, vec3(0.6) * (skyRgb + 0.5 * sunRgb), 0.4 * foam);
    light = mix(light, hazeLight(-v), haze(range));
    colour = vec4(encode(light), 1.0);
    label = vec4(1.0 / 255.0, 0.0, 0.0, 1.0);
}
"""
)
