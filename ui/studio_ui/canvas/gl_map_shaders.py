"""How fragments read mip levels out of atlases, as `studio_core.kernels.compose` reads them from rows."""

from __future__ import annotations

MAPS = """
// Of a map: the place in it, two rows on (u, v, 1); sizes of the finest level and of the atlas; its levels.
#if defined(AFFINE) || defined(GENERAL)
uniform vec3 u_uv_u;
uniform vec3 u_uv_v;
uniform vec4 u_sizes;
uniform float u_levels;
#endif
#ifdef RELIEF
uniform vec3 u_relief_uv_u;
uniform vec3 u_relief_uv_v;
uniform vec4 u_relief_turn;    // of the picture on the surface: two rows on (x, y)
uniform float u_relief_strength;
uniform vec4 u_relief_sizes;
uniform float u_relief_levels;
uniform sampler2D u_relief;
varying vec3 v_bend0;
varying vec3 v_bend1;
varying vec3 v_bend2;
#ifdef AFFINE
varying vec3 v_bend3;
varying vec3 v_bend4;
varying vec3 v_bend5;
#endif
#ifdef GENERAL
varying vec3 v_bend3;
#endif
#endif
uniform float u_pixel_angle;

float repeated(vec2 uv, vec3 row) {
    float made = uv.x * row.x + uv.y * row.y + row.z;
    return made - floor(made);
}

// Left, top, width and height of a level in the atlas.
vec4 place_of(float level, vec2 finest) {
    vec2 size = finest;
    float top = 0.0;
    for (int k = 0; k < LEVELS; k++) {
        if (float(k) >= level) break;
        if (k > 0) top += size.y;
        size = max(floor(0.5 * size), 1.0);
    }
    return vec4(level > 0.5 ? finest.x : 0.0, top, size);
}

// The mip level whose texels are about as large as a pixel; density is that of the face, from derivatives.
vec4 map_level(vec2 uv, vec3 uv_u, vec3 uv_v, vec2 finest, float levels) {
    vec3 across = dFdx(v_eye), down = dFdy(v_eye);
    vec3 normal = cross(across, down);
    float area = max(length(normal), 1e-30);
    vec2 du = dFdx(uv), dv = dFdy(uv);
    float laid = abs(uv_u.x * uv_v.y - uv_u.y * uv_v.x);
    float in_map = abs(du.x * dv.y - du.y * dv.x) * laid * finest.x * finest.y;
    float away = max(length(v_eye), 1e-30);
    float cosine = max(abs(dot(normal, v_eye)) / (area * away), 0.05);
    float footprint = away * u_pixel_angle * sqrt(in_map / area) / sqrt(cosine);
    float level = clamp(floor(log2(max(footprint, 1e-6)) + 0.5), 0.0, levels - 1.0);
    return place_of(level, finest);
}

vec3 texel(sampler2D map, vec4 level, vec2 uv, vec3 uv_u, vec3 uv_v, vec2 atlas) {
    vec2 at = vec2(repeated(uv, uv_u), repeated(uv, uv_v));
    vec2 place = at * level.zw - 0.5;
    vec2 low = floor(place), part = place - low;
    vec2 high = low + 1.0;
    low = mix(low, low + level.zw, vec2(lessThan(low, vec2(0.0))));
    high = mix(high, high - level.zw, vec2(greaterThanEqual(high, level.zw)));
    low = (low + level.xy + 0.5) / atlas;
    high = (high + level.xy + 0.5) / atlas;
    vec3 a = texture2D(map, low).rgb, b = texture2D(map, vec2(high.x, low.y)).rgb;
    vec3 c = texture2D(map, vec2(low.x, high.y)).rgb, d = texture2D(map, high).rgb;
    return mix(mix(a, b, part.x), mix(c, d, part.x), part.y);
}

#ifdef RELIEF
// Components x, y, 1 - z of a mean normal whose slopes are multiplied; see kernels.relief.
vec3 strengthened(vec3 n) {
    if (u_relief_strength == 1.0) return n;
    vec3 way = vec3(n.xy, 1.0 - n.z);
    float spread = max(1.0 - length(way), 0.0);
    way.xy *= u_relief_strength;
    float left = max(1.0 - u_relief_strength * u_relief_strength * spread, SHORTEST);
    way *= left / max(length(way), DARK);
    return vec3(way.xy, 1.0 - way.z);
}
#endif
"""
