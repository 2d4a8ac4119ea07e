"""Shaders of the GPU canvas: what `studio_core.kernels.compose`, `background` and `display` do, per fragment.

GLSL 1.20, the common ground of every desktop driver. Light is multiplied with the exposure where it is
written, so that half floats keep their precision where the display shows it.
"""

from __future__ import annotations

from studio_core.kernels.compose import AFFINE, CAUGHT, GENERAL
from studio_core.kernels.relief import DARK, SHORTEST
from studio_ui.canvas.gl_map_shaders import MAPS
from studio_ui.canvas.gl_sky_shaders import SKY
from studio_ui.canvas.grid import LIFT, REACH, STEPS, WIDE

MESH_VERTEX = """
#version 120
attribute vec3 a_position;
#ifdef LIT
attribute vec3 a_plain;
varying vec3 v_plain;
#endif
#ifdef MAPPED
attribute vec2 a_uv;
varying vec2 v_uv;
#endif
#ifdef SLOPED
attribute vec3 a_slope;
varying vec3 v_slope;
#endif
#ifdef GENERAL
EACH attribute vec3 a_sum@;
EACH varying vec3 v_sum@;
#endif
#ifdef RELIEF
attribute vec3 a_bend0;
attribute vec3 a_bend1;
attribute vec3 a_bend2;
varying vec3 v_bend0;
varying vec3 v_bend1;
varying vec3 v_bend2;
#ifdef AFFINE
attribute vec3 a_bend3;
attribute vec3 a_bend4;
attribute vec3 a_bend5;
varying vec3 v_bend3;
varying vec3 v_bend4;
varying vec3 v_bend5;
#endif
#ifdef GENERAL
attribute vec3 a_bend3;
varying vec3 v_bend3;
#endif
#endif
uniform mat4 u_eye_from_model;
uniform mat4 u_projection;
varying vec3 v_eye;

void main() {
    v_eye = (u_eye_from_model * vec4(a_position, 1.0)).xyz;
#ifdef LIT
    v_plain = a_plain;
#endif
#ifdef MAPPED
    v_uv = a_uv;
#endif
#ifdef SLOPED
    v_slope = a_slope;
#endif
#ifdef GENERAL
EACH    v_sum@ = a_sum@;
#endif
#ifdef RELIEF
    v_bend0 = a_bend0;
    v_bend1 = a_bend1;
    v_bend2 = a_bend2;
#ifdef AFFINE
    v_bend3 = a_bend3;
    v_bend4 = a_bend4;
    v_bend5 = a_bend5;
#endif
#ifdef GENERAL
    v_bend3 = a_bend3;
#endif
#endif
    gl_Position = u_projection * vec4(v_eye, 1.0);
}
"""

MESH_FRAGMENT = (
    """
#version 120
varying vec3 v_plain;
varying vec3 v_eye;
uniform float u_gain;
#ifdef PEELED
uniform sampler2D u_layer;   // alpha: distance of the layer that is shown now
uniform vec2 u_size;
uniform float u_opacity;
#endif
#ifdef MAPPED
varying vec2 v_uv;
"""
    + MAPS
    + """
#endif
#ifdef SLOPED
varying vec3 v_slope;
#endif
#ifdef AFFINE
uniform sampler2D u_map0;
#endif
#ifdef CAUGHT
uniform mat3 u_turn;   // picture from camera
uniform vec3 u_from;   // of the eye, in the picture's frame: 0 where the picture is far away
"""
    + SKY
    + """
#endif
#ifdef GENERAL
EACH varying vec3 v_sum@;
EACH uniform sampler2D u_map@;
#endif

void main() {
    vec3 light = v_plain;
#if defined(AFFINE) || defined(GENERAL)
    vec4 level = map_level(v_uv, u_uv_u, u_uv_v, u_sizes.xy, u_levels);
#endif
#ifdef AFFINE
    vec3 found = texel(u_map0, level, v_uv, u_uv_u, u_uv_v, u_sizes.zw);
    light += found * v_slope;
#endif
#ifdef CAUGHT
    light += sky(u_turn * v_eye + u_from) * v_slope;
#endif
#ifdef GENERAL
EACH    light += texel(u_map@, level, v_uv, u_uv_u, u_uv_v, u_sizes.zw) * v_sum@;
    light = max(light, 0.0);  // captured materials have coefficients below 0
#endif
#ifdef RELIEF
    vec4 fine = map_level(v_uv, u_relief_uv_u, u_relief_uv_v, u_relief_sizes.xy, u_relief_levels);
    vec3 n = texel(u_relief, fine, v_uv, u_relief_uv_u, u_relief_uv_v, u_relief_sizes.zw);
    n = strengthened(n);
    n.xy = vec2(dot(u_relief_turn.xy, n.xy), dot(u_relief_turn.zw, n.xy));
    vec3 more = n.x * v_bend0 + n.y * v_bend1 + n.z * v_bend2;
#ifdef AFFINE
    more += found * (n.x * v_bend3 + n.y * v_bend4 + n.z * v_bend5);
#endif
#ifdef GENERAL
    more *= mix(vec3(0.0), light / max(v_bend3, DARK), vec3(greaterThan(v_bend3, vec3(DARK))));
#endif
    light = max(light + more, 0.0);
#endif
    float away = length(v_eye);
#ifdef PEELED
    float shown = texture2D(u_layer, gl_FragCoord.xy / u_size).a;
    if (abs(away - shown) > 1e-6 * shown) discard;
    gl_FragColor = vec4(u_opacity * u_gain * light, u_opacity);
#else
    gl_FragColor = vec4(u_gain * light, away);
#endif
}
"""
)

LAYER_FRAGMENT = """
#version 120
varying vec3 v_eye;
uniform sampler2D u_opaque;   // alpha: distance of what cannot be looked through
uniform sampler2D u_before;   // alpha: distance of the last layer
uniform vec2 u_size;

void main() {
    vec2 at = gl_FragCoord.xy / u_size;
    float away = length(v_eye);
    if (away > texture2D(u_opaque, at).a * (1.0 + 1e-5)) discard;  // also before what it stands on
    if (away <= texture2D(u_before, at).a * (1.0 + 1e-5)) discard;
    gl_FragColor = vec4(0.0, 0.0, 0.0, away);
}
"""
"""The nearest transparent surface behind the last layer."""

PLAIN_FRAGMENT = """
#version 120
varying vec3 v_eye;
uniform vec4 u_colour;

void main() {
    gl_FragColor = vec4(u_colour.rgb, u_colour.a < 0.0 ? length(v_eye) : u_colour.a);
}
"""
"""One colour: selection masks and picking (there alpha is the distance)."""

SCREEN_VERTEX = """
#version 120
attribute vec2 a_corner;
varying vec2 v_at;

void main() {
    v_at = 0.5 * a_corner + 0.5;
    gl_Position = vec4(a_corner, 1.0, 1.0);
}
"""

STILL_FRAGMENT = """
#version 120
varying vec2 v_at;
uniform sampler2D u_still;
uniform float u_gain;

void main() {
    gl_FragColor = vec4(u_gain * texture2D(u_still, vec2(v_at.x, 1.0 - v_at.y)).rgb, 1e30);
}
"""
"""A finished picture, its rows from the top."""

DISPLAY_FRAGMENT = """
#version 120
varying vec2 v_at;
uniform sampler2D u_opaque;
uniform sampler2D u_clear;    // light of transparent surfaces, and what they let through
uniform sampler2D u_marks;    // red: chosen
uniform vec2 u_size;          // of those, samples
uniform float u_samples;      // along each side of a pixel
uniform float u_layered;
uniform float u_marked;
uniform float u_rim;          // width of the outline, pixels
uniform vec3 u_accent;
uniform float u_gridded;
uniform vec3 u_grid;          // colour of the ground's lines
uniform mat3 u_axes;          // columns: right, up and back of the camera in the world
uniform vec3 u_eye;
uniform vec2 u_extent;
uniform float u_kind;         // 0 colour-true, 1 filmic, 2 raw

float lit(float x) {
    return x > 0.0 ? min(x, 1e6) : 0.0;  // NaN is none
}

vec3 film(vec3 light) {
    vec3 x = vec3(
        dot(vec3(0.59719, 0.35458, 0.04823), light),
        dot(vec3(0.07600, 0.90834, 0.01566), light),
        dot(vec3(0.02840, 0.13383, 0.83777), light));
    x = (x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.4329510) + 0.238081);
    return vec3(
        dot(vec3(1.60475, -0.53108, -0.07367), x),
        dot(vec3(-0.10208, 1.10813, -0.00605), x),
        dot(vec3(-0.00327, -0.07276, 1.07602), x));
}

vec3 curve(vec3 x) {
    return mix(12.92 * x, 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, vec3(greaterThan(x, vec3(0.0031308))));
}

float chosen(vec2 pixel) {
    vec2 at = (pixel * u_samples + vec2(0.5, u_samples - 0.5)) / u_size;
    bool inside = at.x > 0.0 && at.y > 0.0 && at.x < 1.0 && at.y < 1.0;
    return inside ? texture2D(u_marks, at).r : 0.0;
}

float lines(vec2 place, vec2 span, float step) {
    vec2 near = abs(fract(place / step + 0.5) - 0.5) * step / max(span, 1e-9);
    float fine = 1.0 - smoothstep(0.15, 0.6, max(span.x, span.y) / step);
    return fine * clamp(WIDE + 0.5 - min(near.x, near.y), 0.0, 1.0);
}

// See canvas.grid.
float grid(vec2 pixel) {
    vec2 size = u_size / u_samples;
    vec2 at = (2.0 * (pixel + 0.5) / size - 1.0) * u_extent;
    vec3 ray = u_axes * vec3(at, -1.0);
    float reach = -u_eye.y / ray.y;
    float away = reach * length(vec3(at, 1.0));
    float seen = texture2D(u_opaque, (pixel * u_samples + vec2(0.5, u_samples - 0.5)) / u_size).a;
    if (!(reach > 0.0 && away < REACH && away * LIFT <= seen)) return 0.0;
    vec2 step = 2.0 * u_extent / size;
    vec2 span = abs(reach * (u_axes[0].xz - ray.xz * u_axes[0].y / ray.y)) * step.x
        + abs(reach * (u_axes[1].xz - ray.xz * u_axes[1].y / ray.y)) * step.y;
    vec2 place = u_eye.xz + reach * ray.xz;
    float strength = STRENGTHS;
    return strength * (1.0 - smoothstep(0.35, 1.0, away / REACH));
}

void main() {
    vec2 pixel = floor(v_at * u_size / u_samples);
    vec3 light = vec3(0.0);
    for (float y = 0.5; y < u_samples; y += 1.0) {
        for (float x = 0.5; x < u_samples; x += 1.0) {
            vec2 at = (pixel * u_samples + vec2(x, y)) / u_size;
            vec3 here = texture2D(u_opaque, at).rgb;
            if (u_layered > 0.5) {
                vec4 before = texture2D(u_clear, at);
                here = before.rgb + before.a * here;
            }
            light += here;
        }
    }
    light /= u_samples * u_samples;
    light = vec3(lit(light.r), lit(light.g), lit(light.b));
    if (u_kind > 0.5 && u_kind < 1.5) light = film(light);
    vec3 shown = clamp(light, 0.0, 1.0);
    if (u_kind < 1.5) shown = curve(shown);
    if (u_gridded > 0.5) shown = mix(shown, u_grid, grid(pixel));
    if (u_marked > 0.5 && chosen(pixel) < 0.5) {
        float near = 0.0;
        for (float y = -u_rim; y <= u_rim; y += 1.0)
            for (float x = -u_rim; x <= u_rim; x += 1.0)
                if (abs(x) + abs(y) <= u_rim) near = max(near, chosen(pixel + vec2(x, y)));
        if (near > 0.5) shown = u_accent;
    }
    gl_FragColor = vec4(shown, 1.0);
}
"""
"""Samples to pixels: averaged, tone-mapped as `studio_core.kernels.tonemap` does, lines and outline added."""


_NAMES = {
    AFFINE: ("MAPPED", "AFFINE", "SLOPED"),
    GENERAL: ("MAPPED", "GENERAL"),
    CAUGHT: ("CAUGHT", "SLOPED"),
}


def display_program() -> tuple[str, str]:
    """The last pass."""
    strength = "0.0"
    for step, strong in STEPS:
        strength = f"max({strength}, {strong:.6f} * lines(place, span, {step:.6f}))"
    source = DISPLAY_FRAGMENT.replace("STRENGTHS", strength)
    numbers = {"WIDE": WIDE, "REACH": REACH, "LIFT": LIFT}
    defines = "".join(f"#define {name} {value:.6f}\n" for name, value in numbers.items())
    return SCREEN_VERTEX.strip(), _defined(source, defines)


def mesh_program(
    kind: int, peeled: bool, levels: int, terms: int = 3, relief: bool = False
) -> tuple[str, str]:
    """Vertex and fragment shader for surfaces whose coefficients are of a kind of `kernels.compose`.

    `terms`: how many those with a map of their own have; `relief`: with a normal map.
    """
    more = (("PEELED",) if peeled else ()) + (("MAPPED", "RELIEF") if relief else ())
    names = dict.fromkeys(("LIT", *_NAMES.get(kind, ()), *more))
    defines = "".join(f"#define {name}\n" for name in names)
    defines += f"#define LEVELS {levels}\n#define DARK {DARK:e}\n#define SHORTEST {SHORTEST:f}\n"
    vertex, fragment = (_for_each(source, terms) for source in (MESH_VERTEX, MESH_FRAGMENT))
    return _defined(vertex, defines), _defined(fragment, defines)


def _for_each(source: str, terms: int) -> str:
    """Lines that begin with EACH once for every term, with its number for @."""
    made = []
    for line in source.split("\n"):
        if line.startswith("EACH"):
            made += [line.removeprefix("EACH").replace("@", str(k)) for k in range(terms)]
        else:
            made.append(line)
    return "\n".join(made)


def plain_program(fragment: str) -> tuple[str, str]:
    """The surfaces' vertex shader with a fragment shader that does not ask for their light."""
    return _defined(_for_each(MESH_VERTEX, 0), ""), fragment.strip()


def _defined(source: str, defines: str) -> str:
    version, _, rest = source.strip().partition("\n")
    return f"{version}\n{defines}{rest}"
