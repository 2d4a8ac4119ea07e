"""Residual materials: photographs under known lights become a reflectance model and a map of what it lacks.

After residual-srf.txt (Ma et al., "An Efficient Representation of Complex Materials for Real-Time
Rendering"): f = f_r + δ*, with δ* = s(P) · H at each texel. Everything here works on arrays, without a
window.

- what is known: `samples` (lights, ball, samples), `lights` (tables, `.lp` files, mirror ball), `names`
  (what a set of file names tells), `folder` (what belongs together)
- from pictures: `brackets` (exposures become light), `pictures` (a folder's light), `ball` (where the sphere
  is, to a fraction of a pixel), `light_check` (sides, camera), `reflectance_map`, `flat`
- BTFs: `btf` (what one is), `btf_pictures` (folders, zip files), `btf_factored` (`.btf` files), `btf_solve`
  (least squares that grow with the pictures), `btf_fit`
- the fit: `parametric` (f_r), `bases` (δ*), `tables` (what all texels share), `masks`, `solve` (rank-aware,
  robust), `refine` (light directions and strengths), `fit` puts them in order and chooses
- what came of it: `result`, `errors`, `splits`, `frames` (tangent space)
- in a scene: `model` (the reflectance model `captured`), `material` (a fit as a material), `backend`
- from the window: `reading` (a request's photographs as samples), `fitter` (the registry's kind)

Values are radiance under a light of strength 1, by which a white matte surface that faces it has the value 1
(irradiance π). The camera looks along −z: x to the right, y up, z towards the camera.
"""

from studio_core.contract import API, Plugin

plugin = Plugin(
    id="residual",
    label="Residual materials: cloth and stone from photographs",
    api=API,
    provides={
        "brdf": {"captured": "studio_plugins.residual.model:MODEL"},
        "backend": {"residual": "studio_plugins.residual.backend:BACKEND"},
        "fitter": {"photographs": "studio_plugins.residual.fitter:FITTER"},
    },
)
