"""Shaders of the backdrop: what `studio_core.kernels.background` does, per fragment."""

from __future__ import annotations

SKY = """
uniform sampler2D u_sky;
uniform vec2 u_sky_size;
const float PI = 3.14159265358979;

vec3 sky_at(float column, float row) {
    column = mod(column, u_sky_size.x);
    row = clamp(row, 0.0, u_sky_size.y - 1.0);
    return texture2D(u_sky, (vec2(column, row) + 0.5) / u_sky_size).rgb;
}

// The equirectangular picture in a direction of its own frame.
vec3 sky(vec3 d) {
    float s = (0.5 - atan(d.x, d.z) / (2.0 * PI)) * u_sky_size.x - 0.5;
    float t = atan(length(d.xz), d.y) / PI * u_sky_size.y - 0.5;
    float s0 = floor(s), t0 = floor(t);
    vec3 near = mix(sky_at(s0, t0), sky_at(s0 + 1.0, t0), s - s0);
    vec3 far = mix(sky_at(s0, t0 + 1.0), sky_at(s0 + 1.0, t0 + 1.0), s - s0);
    return mix(near, far, t - t0);
}
"""
"""Looks up the photograph; for surfaces that show it as well."""

BACKDROP_FRAGMENT = (
    """
#version 120
varying vec2 v_at;
uniform mat3 u_turn;   // picture from camera; with a dome, from the world
uniform mat3 u_axes;   // world from camera
uniform float u_domed;
uniform vec3 u_from;   // the eye from where the picture was taken, world
uniform vec2 u_dome;   // height and radius
uniform vec2 u_extent; // half width and half height of the picture at distance 1
uniform vec3 u_light;  // gain and exposure
"""
    + SKY
    + """
// See kernels.background.reach_of_dome.
vec3 on_dome(vec3 d) {
    float over = u_from.y + u_dome.x, across = dot(u_from.xz, u_from.xz);
    if (over <= 0.0 || across + over * over >= u_dome.y * u_dome.y) return d;
    if (d.y < 0.0) {
        vec3 met = u_from - over / d.y * d;
        if (dot(met.xz, met.xz) <= u_dome.y * u_dome.y) return met;
    }
    float a = dot(d, d), b = dot(u_from.xz, d.xz) + over * d.y;
    float c = across + over * over - u_dome.y * u_dome.y;
    return u_from + (sqrt(max(b * b - a * c, 0.0)) - b) / a * d;
}

void main() {
    vec3 d = vec3((2.0 * v_at - 1.0) * u_extent, -1.0);
    if (u_domed > 0.5) d = on_dome(u_axes * d);
    gl_FragColor = vec4(u_light * sky(u_turn * d), 1e30);
}
"""
)
