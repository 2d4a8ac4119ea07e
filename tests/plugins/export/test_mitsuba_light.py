"""Light at points by Mitsuba from exported scenes, against closed forms and sums over pixels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.brdf import ORACLES, albedo, unit
from oracles.primary import environment

from studio_core.imaging.latlong import pixel_directions, pixel_solid_angles
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import (
    AreaLamp,
    DirectionalLamp,
    Environment,
    Material,
    MeshObject,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.transform import Transform, looking
from studio_plugins.brdfs.ggx import MODEL as GGX
from studio_plugins.export import mitsuba_run
from studio_plugins.export.mitsuba import EXPORTER

pytest.importorskip("mitsuba", reason="the extra `peers` (Mitsuba 3) is not installed")

RNG = np.random.default_rng(8)
POINTS = RNG.uniform(-1, 1, (40, 3))
NORMALS = unit(RNG.normal(size=(40, 3)) + np.array([0, 1.5, 0]))


def lit_by(light: Any, *more: Any) -> Scene:
    return Scene().with_materials(Material(id="grey")).with_nodes(light, *more)


def irradiance(scene: Scene, host: PluginHost, folder: Path, spp: int = 512) -> Any:
    EXPORTER.save(scene, folder, host)
    return mitsuba_run.vertex_irradiance(folder, POINTS, NORMALS, spp, offset=0.0)


def towards(place: Any) -> tuple[Any, Any, Any]:
    """Direction, distance and cosine from the points to a place."""
    gap = np.asarray(place) - POINTS
    distance = np.linalg.norm(gap, axis=1)
    direction = gap / distance[:, None]
    return direction, distance, np.maximum((direction * NORMALS).sum(1), 0)


def test_an_even_sky(host: PluginHost, tmp_path: Path) -> None:
    sky = Environment(id="sky", image=Image(np.full((8, 16, 3), 0.7, np.float32)), intensity=2.0)
    made = irradiance(lit_by(sky), host, tmp_path, 1 << 14)
    np.testing.assert_allclose(made.value, np.pi * 1.4, rtol=2e-3)
    assert 0 < made.relative_error < 1e-3


def test_a_coloured_sky_is_the_sum_over_its_pixels(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    image = parts["environment"]()
    sky = Environment(id="sky", image=image, azimuth=70.0, tilt=-30.0)
    made = irradiance(lit_by(sky), host, tmp_path, 1 << 14)
    height, width = 256, 512
    d = pixel_directions(height, width).reshape(-1, 3)
    weight = np.repeat(pixel_solid_angles(height, width), width)
    radiance = environment(image.pixels.astype(float), 70.0, -30.0, d)
    wanted = (np.maximum(NORMALS @ d.T, 0) * weight) @ radiance
    error = np.sqrt(((made.value - wanted) ** 2).mean()) / wanted.mean()
    assert error < 4e-3
    assert error / 2 < made.relative_error < 2 * error


def test_a_point_lamp(host: PluginHost, tmp_path: Path) -> None:
    lamp = PointLamp(id="lamp", intensity=7.0, tint=(1.0, 0.5, 0.25), transform=Transform((0.5, 3.0, 1.0)))
    made = irradiance(lit_by(lamp), host, tmp_path, 8)
    _, distance, cosine = towards((0.5, 3.0, 1.0))
    wanted = (7 * cosine / distance**2)[:, None] * [1, 0.5, 0.25]
    np.testing.assert_allclose(made.value, wanted, rtol=1e-4, atol=1e-6)


def test_a_spot_lamp_has_our_falloff(host: PluginHost, tmp_path: Path) -> None:
    place = (0.5, 4.0, 1.0)
    lamp = SpotLamp(id="lamp", intensity=7.0, cone=12.0, inner=5.0, transform=looking(place, (0, 0, 0)))
    made = irradiance(lit_by(lamp), host, tmp_path, 8)
    direction, distance, cosine = towards(place)
    axis = -unit(np.array(place))
    low, high = np.cos(np.radians([12.0, 5.0]))
    t = np.clip((-(direction @ axis) - low) / (high - low), 0, 1)
    wanted = 7 * cosine / distance**2 * t * t * (3 - 2 * t)
    assert 0 < (t == 0).sum() < len(t)
    np.testing.assert_allclose(made.value[:, 1], wanted, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("angle", [0.0, 0.53, 20.0])
def test_a_sun(host: PluginHost, tmp_path: Path, angle: float) -> None:
    lamp = DirectionalLamp(id="sun", intensity=3.0, angle=angle, transform=looking((1, 2, 3), (0, 0, 0)))
    made = irradiance(lit_by(lamp), host, tmp_path)
    cosine = NORMALS @ unit(np.array([1.0, 2, 3]))
    clear = np.abs(cosine) > np.sin(np.radians(angle / 2)) + 1e-3  # the whole disc is up or down
    tolerance = 1e-3 if angle < 1 else 2e-2  # of a wide disc, the mean cosine is a little lower
    wanted = 3 * np.maximum(cosine, 0)
    np.testing.assert_allclose(made.value[clear, 0], wanted[clear], rtol=tolerance, atol=5e-4)


def test_an_area_lamp_is_lamberts_polygon(host: PluginHost, tmp_path: Path) -> None:
    placed = looking((0.2, 2.5, 0.5), (0, 0, 0))
    lamp = AreaLamp(id="lamp", intensity=4.0, width=1.2, height=0.6, transform=placed)
    made = irradiance(lit_by(lamp), host, tmp_path, 4096)
    local = np.array([[-0.6, -0.3, 0, 1], [0.6, -0.3, 0, 1], [0.6, 0.3, 0, 1], [-0.6, 0.3, 0, 1]])
    corners = (local @ placed.matrix().T)[:, :3]
    facing = (POINTS - corners[0]) @ placed.matrix()[:3, 2] < 0
    wanted = np.zeros(len(POINTS))
    whole = facing.copy()
    for k, (p, n) in enumerate(zip(POINTS, NORMALS, strict=True)):
        r = unit(corners - p)
        whole[k] &= bool((r @ n > 0).all())
        for a, b in zip(r, np.roll(r, -1, axis=0), strict=True):  # Lambert 1760: ½ Σ angle · edge normal
            wanted[k] += 0.5 * 4 * np.arccos(np.clip(a @ b, -1, 1)) * (unit(np.cross(a, b)) @ n)
    assert whole.sum() > 10
    np.testing.assert_allclose(made.value[whole, 0], np.abs(wanted)[whole], rtol=5e-3)
    assert not made.value[(POINTS - corners[0]) @ placed.matrix()[:3, 2] > 0].any()


def test_a_roof_stops_the_light(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    lamp = PointLamp(id="lamp", intensity=7.0, transform=Transform((0.0, 3.0, 0.0)))
    cube = parts["cube"]()
    roof = MeshObject(
        id="roof", geometry=cube, materials=("grey",), transform=Transform((0.0, 2.0, 0.0), scale=0.8)
    )
    EXPORTER.save(lit_by(lamp, roof), tmp_path, host)
    points = np.array([[0, 0, 0], [0.3, 0, 0.2], [3.0, 0, 0]])
    up = np.tile([0.0, 1, 0], (3, 1))
    made = mitsuba_run.vertex_irradiance(tmp_path, points, up, 8)
    assert not made.value[:2].any()
    np.testing.assert_allclose(made.value[2], 7 * 3 / 18**1.5, rtol=1e-4)


BSDFS = {
    "ggx": ({"type": "lucarne_ggx", "alpha": 0.64, "metallic": 0.25, "specular": 0.75,
             "facets": " ".join(map(repr, GGX.shape({"roughness": 0.8})[1:].tolist()))},
            {"roughness": 0.8, "metallic": 0.25, "specular": 0.75, "base_color": np.array([0.8])}),
    "specgloss": ({"type": "lucarne_specgloss", "alpha": 0.25, "diffuse": 0.7, "specular": 0.012,
                   "facets": " ".join(map(repr, GGX.shape({"roughness": 0.5})[1:].tolist()))},
                  {"roughness": 0.5, "diffuse": np.array([0.7]), "specular": np.array([0.012])}),
    "phong": ({"type": "lucarne_phong", "exponent": 120.0, "diffuse": 0.3, "specular": 0.9},
              {"exponent": 120.0, "diffuse": np.array([0.3]), "specular": np.array([0.9])}),
    "blinn-phong": ({"type": "lucarne_blinn_phong", "exponent": 90.0, "diffuse": 0.3, "specular": 0.5},
                    {"exponent": 90.0, "diffuse": np.array([0.3]), "specular": np.array([0.5])}),
}  # fmt: skip


@pytest.mark.parametrize("model", BSDFS)
def test_radiance_under_an_even_sky_is_the_albedo(host: PluginHost, tmp_path: Path, model: str) -> None:
    sky = Environment(id="sky", image=Image(np.full((8, 16, 3), 2.0, np.float32)))
    EXPORTER.save(lit_by(sky), tmp_path, host)
    theta = np.radians([0, 20, 45, 70, 85])
    wo = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=1)
    bsdf, values = BSDFS[model]
    up = np.tile([0.0, 0, 1], (len(wo), 1))
    made = mitsuba_run.vertex_radiance(tmp_path, 0 * up, up, wo, bsdf, 1 << 15)
    wanted = 2 * albedo(lambda row, wi: ORACLES[model](values, wo[row], wi), wo)[:, 0]
    np.testing.assert_allclose(made.value[:, 0], wanted, rtol=5e-3)


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "scalar_rgb"])
@pytest.mark.parametrize("model", BSDFS)
def test_our_bsdfs_are_the_oracle(model: str, variant: str) -> None:
    mi = mitsuba_run.mitsuba(variant)
    import drjit as dr

    bsdf, values = BSDFS[model]
    made = mi.load_dict(bsdf)
    count = 400 if variant == "llvm_ad_rgb" else 30
    rng = np.random.default_rng(4)
    wi, wo = (unit(rng.normal(size=(count, 3))) for _ in range(2))
    wi[:, 2] = np.abs(wi[:, 2])
    near = count // 2
    wo[:near] = unit(wi[:near] * [-1, -1, 1] + 0.2 * rng.normal(size=(near, 3)))
    truth = ORACLES[model](values, wi, wo)[:, 0] * np.maximum(wo[:, 2], 0)
    context = mi.BSDFContext()
    if variant == "llvm_ad_rgb":
        si = dr.zeros(mi.SurfaceInteraction3f, count)
        si.wi = mi.Vector3f(*wi.T.astype(np.float32))
        found = np.array(made.eval(context, si, mi.Vector3f(*wo.T.astype(np.float32))))[0]
    else:
        found = np.empty(count)
        for k in range(count):
            si = mi.SurfaceInteraction3f()
            si.wi = mi.Vector3f(*wi[k])
            found[k] = made.eval(context, si, mi.Vector3f(*wo[k]))[0]
    np.testing.assert_allclose(found, truth, rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize("model", BSDFS)
def test_sampling_has_the_density_it_states(model: str) -> None:
    """χ² of sampled directions over cells of equal area against the integrated density."""
    mi = mitsuba_run.mitsuba()
    import drjit as dr

    made, count, cells, fine = mi.load_dict(BSDFS[model][0]), 200_000, 16, 24
    wi = unit(np.array([0.5, 0.2, 0.9])).astype(np.float32)
    rng = np.random.default_rng(6)

    def at(n: int) -> Any:
        si = dr.zeros(mi.SurfaceInteraction3f, n)
        si.wi = mi.Vector3f(*(np.full(n, c, np.float32) for c in wi))
        return si

    u = rng.random((3, count), np.float32)
    bs, _ = made.sample(mi.BSDFContext(), at(count), mi.Float(u[0]), mi.Point2f(u[1], u[2]))
    wo, pdf = np.array(bs.wo), np.array(bs.pdf)
    up = pdf > 0
    column = ((np.arctan2(wo[1], wo[0]) / (2 * np.pi)) % 1 * 2 * cells).astype(int) % (2 * cells)
    row = np.clip(wo[2] * cells, 0, cells - 1).astype(int)
    observed = np.bincount((row * 2 * cells + column)[up], minlength=2 * cells * cells)
    z, phi = np.meshgrid(
        (np.arange(cells * fine) + 0.5) / (cells * fine),
        (np.arange(2 * cells * fine) + 0.5) / (2 * cells * fine) * 2 * np.pi,
        indexing="ij",
    )
    ring = np.sqrt(1 - z * z)
    grid = np.stack([ring * np.cos(phi), ring * np.sin(phi), z]).reshape(3, -1).astype(np.float32)
    density = np.array(made.pdf(mi.BSDFContext(), at(grid.shape[1]), mi.Vector3f(*grid)))
    density = density.reshape(cells, fine, 2 * cells, fine).mean(axis=(1, 3)).ravel()
    expected = density * 2 * np.pi / (2 * cells * cells) * count
    used = expected > 20
    assert used.sum() > 100
    chi2 = ((observed - expected)[used] ** 2 / expected[used]).sum()
    assert chi2 < used.sum() + 6 * np.sqrt(2 * used.sum())


def test_mitsubas_own_conductor_is_our_white_metal_without_bounces(host: PluginHost) -> None:
    mi = mitsuba_run.mitsuba()
    import drjit as dr

    native = mi.load_dict(
        {
            "type": "roughconductor",
            "material": "none",
            "distribution": "ggx",
            "alpha": 0.16,
            "sample_visible": True,
        }
    )
    rng = np.random.default_rng(4)
    wi, wo = (unit(np.abs(rng.normal(size=(500, 3))) * [1, 1, 1]) for _ in range(2))
    wo = unit(wo * rng.choice([-1, 1], (500, 3)) * [1, 1, 0] + wo * [0, 0, 1])
    si = dr.zeros(mi.SurfaceInteraction3f, 500)
    si.wi = mi.Vector3f(*wi.T.astype(np.float32))
    found = np.array(native.eval(mi.BSDFContext(), si, mi.Vector3f(*wo.T.astype(np.float32))))[0]
    values = {
        "base_color": np.array([1.0]),
        "metallic": 1.0,
        "specular": 0.5,
        "roughness": 0.4,
        "keep_energy": False,
    }
    truth = ORACLES["ggx"](values, wi, wo)[:, 0] * wo[:, 2]
    np.testing.assert_allclose(found, truth, rtol=2e-3, atol=1e-6)
    assert host.brdf("ggx").shape(values)[0] == np.float32(0.16)
