"""Reflectance models of Lucarne Studio that Mitsuba 3 lacks, as Mitsuba plugins.

Set a variant (`scalar_rgb`, `llvm_ad_rgb`, `cuda_ad_rgb`), import this module, call `register()`, load
scene.xml. Formulas and sources stand with each class; every parameter may be a texture except `exponent`
and `alpha`.
"""

from __future__ import annotations

import importlib
from typing import Any

dr: Any = importlib.import_module("drjit")
mi: Any = importlib.import_module("mitsuba")

INV_PI = 1 / dr.pi


class _Lobed(mi.BSDF):  # type: ignore[misc]
    """A matte part and one lobe: what all models here share.

    Directions are sampled half by the cosine and half by the lobe.
    """

    def __init__(self, props: Any) -> None:
        mi.BSDF.__init__(self, props)
        side = mi.BSDFFlags.FrontSide
        self.m_components = [mi.BSDFFlags.DiffuseReflection | side, mi.BSDFFlags.GlossyReflection | side]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def reflectance(self, si: Any, wo: Any, active: Any) -> Any:
        """f_r for si.wi and wo, both above the surface."""
        raise NotImplementedError

    def lobe_sample(self, wi: Any, sample: Any) -> Any:
        """A direction of the lobe, maybe below the surface."""
        raise NotImplementedError

    def lobe_pdf(self, wi: Any, wo: Any) -> Any:
        """Its density per solid angle."""
        raise NotImplementedError

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
        """See mitsuba.BSDF."""
        by_cosine = sample1 < 0.5
        cosine, lobe = mi.warp.square_to_cosine_hemisphere(sample2), self.lobe_sample(si.wi, sample2)
        wo = mi.Vector3f(*(dr.select(by_cosine, cosine[i], lobe[i]) for i in range(3)))
        value, pdf = self.eval_pdf(ctx, si, wo, active)
        made = mi.BSDFSample3f()
        made.wo = wo
        made.pdf = pdf
        made.eta = 1.0
        made.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        made.sampled_component = mi.UInt32(1)
        active = active & (pdf > 0)
        return made, dr.select(active, value / dr.maximum(pdf, 1e-30), mi.Color3f(0))

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        """See mitsuba.BSDF."""
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        """See mitsuba.BSDF."""
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        """See mitsuba.BSDF."""
        active = active & (si.wi.z > 0) & (wo.z > 0)
        value = self.reflectance(si, wo, active) * wo.z
        pdf = 0.5 * wo.z * INV_PI + 0.5 * self.lobe_pdf(si.wi, wo)
        return dr.select(active, value, mi.Color3f(0)), dr.select(active, pdf, 0)

    def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
        """See mitsuba.BSDF: π f_r of the direction straight up."""
        return self.reflectance(si, mi.Vector3f(0, 0, 1), active) * dr.pi

    def traverse(self, callback: Any) -> None:
        """Nothing to edit."""

    def to_string(self) -> str:
        """The plugin's name."""
        return type(self).__name__


class _Highlight(_Lobed):
    """diffuse / π + specular · lobe; where diffuse + specular > 1 both are divided by their sum."""

    def __init__(self, props: Any) -> None:
        _Lobed.__init__(self, props)
        self.diffuse = props.get_texture("diffuse", 0.6)
        self.specular = props.get_texture("specular", 0.1)
        self.exponent = float(props.get("exponent", 50.0))

    def lobe(self, wi: Any, wo: Any) -> Any:
        """The normalised lobe."""
        raise NotImplementedError

    def reflectance(self, si: Any, wo: Any, active: Any) -> Any:
        """The formula of the class."""
        diffuse, specular = self.diffuse.eval(si, active), self.specular.eval(si, active)
        excess = dr.maximum(diffuse + specular, 1)
        return diffuse / excess * INV_PI + specular / excess * self.lobe(si.wi, wo)


class Phong(_Highlight):
    """(n + 2) / 2π · cos^n about the mirror direction (Lafortune & Willems 1994, eqs. 2–4)."""

    def lobe(self, wi: Any, wo: Any) -> Any:
        """(n + 2) / 2π cos^n a."""
        return (self.exponent + 2) / (2 * dr.pi) * _power(_mirror(wi), wo, self.exponent)

    def lobe_sample(self, wi: Any, sample: Any) -> Any:
        """cos^n about the mirror direction."""
        local = _cosine_power(sample, self.exponent)
        return mi.Frame3f(_mirror(wi)).to_world(local)

    def lobe_pdf(self, wi: Any, wo: Any) -> Any:
        """(n + 1) / 2π cos^n a."""
        return (self.exponent + 1) / (2 * dr.pi) * _power(_mirror(wi), wo, self.exponent)


class BlinnPhong(_Highlight):
    """(n + 2)(n + 4) / (8π (2^(−n/2) + n)) · (n·h)^n: albedo 1 at normal incidence."""

    def lobe(self, wi: Any, wo: Any) -> Any:
        """The formula of the class."""
        n = self.exponent
        peak = (n + 2) * (n + 4) / (8 * dr.pi * (2 ** (-n / 2) + n))
        return peak * _power(mi.Vector3f(0, 0, 1), dr.normalize(wi + wo), n)

    def lobe_sample(self, wi: Any, sample: Any) -> Any:
        """cos^(n+1) of the half vector."""
        h = _cosine_power(sample, self.exponent + 1)
        return 2 * dr.dot(wi, h) * h - wi

    def lobe_pdf(self, wi: Any, wo: Any) -> Any:
        """(n + 2) / 2π (n·h)^(n+1) / (4 ω·h)."""
        h = dr.normalize(wi + wo)
        density = (self.exponent + 2) / (2 * dr.pi) * _power(mi.Vector3f(0, 0, 1), h, self.exponent + 1)
        return density / (4 * dr.maximum(dr.dot(wi, h), 1e-6))


class Ggx(_Lobed):
    """A matte part under GGX with separable Smith masking, Schlick's Fresnel term and light between facets.

    Parameters: base_color, metallic, specular (F0 = 0.08 · specular of what is not metal), alpha, and as
    `facets` the numbers that belong to alpha: both weights of the light that bounced, the weight of the matte
    part, and for a cosine c, with s = k / (c + k) and x = a s + b, the polynomials of what one bounce leaves
    out, s² p(x), and of the edge's share of what it returns, q(x), each as k, a, b and coefficients.
    """

    def __init__(self, props: Any) -> None:
        _Lobed.__init__(self, props)
        self.take(props)
        self.alpha = max(float(props.get("alpha", 0.25)), 1e-4)
        numbers = [float(number) for number in str(props["facets"]).split()]
        self.plain, self.coloured, self.ground = numbers[:3]
        self.gap, self.edge = numbers[3:19], numbers[19:]
        self.facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, True)

    def take(self, props: Any) -> None:
        """The parameters that colours are made of."""
        self.base_color = props.get_texture("base_color", 0.8)
        self.metallic = props.get_texture("metallic", 0.0)
        self.specular = props.get_texture("specular", 0.5)

    def colours(self, si: Any, active: Any) -> Any:
        """Of the matte part below the rim and of that which has none, F0, F90, and what of F0 bounces."""
        base = self.base_color.eval(si, active)
        metallic, dielectric = self.metallic.eval_1(si, active), 0.08 * self.specular.eval_1(si, active)
        f0 = dielectric * (1 - metallic) + base * metallic
        below = base * (1 - metallic)
        return below * (1 - dielectric), mi.Color3f(0), f0, 1, _bounced(f0) + below * dielectric

    def reflectance(self, si: Any, wo: Any, active: Any) -> Any:
        """The formula of the class."""
        wi = si.wi
        below, plain, f0, f90, bounced = self.colours(si, active)
        h = dr.normalize(wi + wo)
        away = 1 - dr.clip(dr.dot(wi, h), 0, 1)
        fresnel = f0 + (f90 - f0) * away**5
        a2 = self.alpha**2
        slope = a2 * h.z * h.z + h.x * h.x + h.y * h.y
        density = a2 * INV_PI / (slope * slope)
        masking = _smith(wi.z, a2) * _smith(wo.z, a2)
        lost_i, lost_o = self._lost(wi.z), self._lost(wo.z)
        matte = below * self.ground * self._below(wi.z, lost_i) * self._below(wo.z, lost_o)
        bounced = self.plain * f0 + self.coloured * bounced
        return (matte + plain) * INV_PI + fresnel * density * masking + bounced * lost_i * lost_o

    def _lost(self, cosine: Any) -> Any:
        """What one bounce leaves out."""
        s = self.gap[0] / (cosine + self.gap[0])
        return dr.clip(s * s * _curve(s, self.gap), 0, 1)

    def _below(self, cosine: Any, lost: Any) -> Any:
        """What the edge's part of Schlick's term leaves to the matte part."""
        return 1 - (1 - lost) * dr.clip(_curve(self.edge[0] / (cosine + self.edge[0]), self.edge), 0, 1)

    def lobe_sample(self, wi: Any, sample: Any) -> Any:
        """By visible facets."""
        h = self.facets.sample(wi, sample)[0]
        return 2 * dr.dot(wi, h) * h - wi

    def lobe_pdf(self, wi: Any, wo: Any) -> Any:
        """Of visible facets, through the half vector."""
        h = dr.normalize(wi + wo)
        return self.facets.pdf(wi, h) / (4 * dr.maximum(dr.dot(wi, h), 1e-6))


class SpecularGloss(Ggx):
    """The facets of `Ggx` under the colours of a matte part, `diffuse`, and of F0, `specular`.

    F90 is 50 times F0's brightest channel, 1 at most; where it is less, so much of the matte part is plain.
    """

    def take(self, props: Any) -> None:
        """The parameters that colours are made of."""
        self.diffuse = props.get_texture("diffuse", 0.8)
        self.specular = props.get_texture("specular", 0.04)

    def colours(self, si: Any, active: Any) -> Any:
        """As of `Ggx`."""
        diffuse, f0 = self.diffuse.eval(si, active), self.specular.eval(si, active)
        f90 = dr.minimum(50 * dr.max(f0), 1)
        matte = diffuse * (1 - f0)
        return matte * f90, matte * (1 - f90), f0, f90, (1 - diffuse) * _bounced(f0) + diffuse * f0


def _bounced(f0: Any) -> Any:
    """g(F0): how much more than B F0 the light between facets has of F0."""
    t = dr.maximum(f0 - 0.08, 0) / 0.92
    return 0.49 * t * t / (1 - 0.51 * t)


def _curve(s: Any, numbers: list[float]) -> Any:
    """The polynomial of `Ggx` whose k, a, b and coefficients these are."""
    x = dr.minimum(numbers[1] * s + numbers[2], 1)
    made: Any = numbers[-1]
    for coefficient in numbers[-2:2:-1]:
        made = made * x + coefficient
    return made


def _mirror(w: Any) -> Any:
    return mi.Vector3f(-w.x, -w.y, w.z)


def _power(axis: Any, w: Any, n: float) -> Any:
    """cos^n of the angle between unit vectors; from their distance, since 1 − cos drowns in rounding."""
    gap = w - axis
    t = 0.5 * dr.dot(gap, gap)
    near = -t * (1 + t * (0.5 + t * (1 / 3 + t * 0.25)))  # log(1 − t)
    log = dr.select(t < 0.02, near, dr.log(dr.maximum(1 - t, 1e-30)))
    return dr.select(t < 1, dr.exp(n * log), 0)


def _cosine_power(sample: Any, n: float) -> Any:
    """A direction with density (n + 1) / 2π cos^n about z."""
    log = dr.log(dr.maximum(1 - sample.x, 1e-12)) / (n + 1)
    cosine = dr.exp(log)
    sine = dr.sqrt(dr.maximum(-dr.expm1(2 * log) if hasattr(dr, "expm1") else 1 - cosine * cosine, 0))
    turn = 2 * dr.pi * sample.y
    return mi.Vector3f(sine * dr.cos(turn), sine * dr.sin(turn), cosine)


def _smith(cosine: Any, a2: float) -> Any:
    """G1 / (2 cosine) of GGX."""
    return 1 / (cosine + dr.sqrt(a2 + (1 - a2) * cosine * cosine))


def register() -> None:
    """Make the models known to the variant that is set."""
    mi.register_bsdf("lucarne_phong", Phong)
    mi.register_bsdf("lucarne_blinn_phong", BlinnPhong)
    mi.register_bsdf("lucarne_ggx", Ggx)
    mi.register_bsdf("lucarne_specgloss", SpecularGloss)
