"""Reflectance by directions and wavelengths: its colours, its text, and the table made of it."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.brdf import ggx

from studio_core.brdfs import spectra, tabulated
from studio_core.brdfs.bound import bound
from studio_core.brdfs.samples import Samples
from studio_core.brdfs.scattered import table_of
from studio_core.errors import InputError
from studio_core.kernels.pairs import evaluate_pairs
from studio_core.params import defaults
from studio_plugins.brdfs.measured import MODEL, SLOT
from studio_plugins.brdfs.measured_files import TABULATED

F64 = npt.NDArray[np.float64]
GLOSSY = {"base_color": (0.7, 0.3, 0.1), "metallic": 0.0, "roughness": 0.6, "specular": 0.5}


def test_whites_of_the_illuminants() -> None:
    for name, x, y in (("D65", 0.3127, 0.3290), ("E", 1 / 3, 1 / 3)):
        xyz = (spectra.illuminant(name)[:, None] * spectra.observer(spectra.WAVELENGTHS)).sum(axis=0)
        np.testing.assert_allclose(xyz[:2] / xyz.sum(), (x, y), atol=1e-3)
    with pytest.raises(ValueError, match="known: D65, E"):
        spectra.illuminant("F11")


@given(
    start=st.floats(380, 440),
    step=st.floats(1, 60),
    grey=st.floats(0, 1),
    light=st.sampled_from(["D65", "E"]),
)
def test_grey_stays_grey(start: float, step: float, grey: float, light: str) -> None:
    nm = np.arange(start, 700, step)
    np.testing.assert_allclose(np.full(len(nm), grey) @ spectra.rec709_weights(nm, light), grey, atol=1e-9)


def test_colours_are_sums_over_wavelengths() -> None:
    nm = np.arange(380.0, 781.0, 5.0)
    reflectance = 0.2 + 0.6 / (1 + np.exp(-(nm - 560) / 20))  # orange
    found = reflectance @ spectra.rec709_weights(nm)
    xyz, white = np.zeros(3), np.zeros(3)
    for wavelength, power, share in zip(nm, spectra.illuminant("D65"), reflectance, strict=True):
        white += power * spectra.observer(wavelength)
        xyz += power * share * spectra.observer(wavelength)
    m = np.array(
        [
            [0.4124564, 0.3575761, 0.1804375],
            [0.2126729, 0.7151522, 0.0721750],
            [0.0193339, 0.1191920, 0.9503041],
        ]
    )
    np.testing.assert_allclose(found, np.linalg.solve(m, xyz / white[1]), atol=2e-3)
    assert found[0] > found[1] > found[2]
    np.testing.assert_allclose(spectra.from_xyz(white / white[1]), 1, atol=1e-9)
    with pytest.raises(ValueError, match="ascend"):
        spectra.rec709_weights([500, 500])


def angles() -> tuple[F64, F64, F64]:
    grid = np.meshgrid(np.arange(0, 76, 15.0), np.arange(0, 86, 5.0), np.arange(0, 181, 15.0), indexing="ij")
    theta_i, theta_o, phi = (a.ravel() for a in grid)
    return theta_i, theta_o, phi


def directions(theta: F64, phi: F64) -> F64:
    t, p = np.radians(theta), np.radians(phi)
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)


def values(theta_i: F64, theta_o: F64, phi: F64) -> F64:
    return ggx(GLOSSY, directions(theta_o, phi), directions(theta_i, 0 * phi))


def written(path: Path, header: str, rows: Any) -> Path:
    path.write_text(header + "\n" + "\n".join(",".join(f"{x:.9g}" for x in row) for row in rows) + "\n")
    return path


def test_a_table_of_scattered_samples_is_near_what_made_them() -> None:
    where = angles()
    path_samples = Samples(
        directions(where[0], 0 * where[2]).astype(np.float32),
        directions(where[1], where[2]).astype(np.float32),
        values(*where),
        np.ones(len(where[0])),
    )
    model = bound(MODEL, {SLOT: table_of(path_samples, "Glossy", (60, 20, 16))})
    rng = np.random.default_rng(0)
    theta_i, theta_o, phi = rng.uniform(0, 70, 500), rng.uniform(0, 75, 500), rng.uniform(0, 180, 500)
    wi, wo = directions(theta_i, 0 * phi), directions(theta_o, phi)
    found = evaluate_pairs(
        model, model.shape(defaults(MODEL.Params)), wo.astype(np.float32), wi.astype(np.float32)
    )
    truth = ggx(GLOSSY, wo, wi)
    assert np.median(np.abs(found / truth - 1)) < 0.02
    assert np.sqrt(((found - truth) ** 2).sum() / (truth**2).sum()) < 0.1


@pytest.mark.parametrize("kind", ["csv", "astm"])
def test_both_forms_say_the_same(tmp_path: Path, kind: str) -> None:
    theta_i, theta_o, phi = angles()
    rgb = values(theta_i, theta_o, phi)
    if kind == "csv":
        header = "# name: Lacquer\n# angles: degrees\ntheta_i,theta_o,phi,R,G,B"
        rows = np.column_stack([theta_i, theta_o, phi, rgb])
    else:
        header = f"TITLE Lacquer\nNUM_POINTS {len(phi)}\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B"
        turned = np.radians([theta_i, 0 * phi + 20, theta_o, phi + 20])
        rows = np.column_stack([*turned, rgb])
    found = tabulated.read(written(tmp_path / f"lacquer.{kind}", header, rows))
    assert found.name == ("Lacquer" if kind == "csv" else "lacquer")
    assert found.notes == ()
    samples = found.samples
    assert len(samples) > 1.8 * len(phi)  # the other side of the plane, too
    np.testing.assert_allclose(ggx(GLOSSY, samples.wo, samples.wi), samples.values, rtol=1e-3)


def test_spectra_become_colours(tmp_path: Path) -> None:
    rows = [(*where, 0.05, 0.05, 0.2) for where in zip(*angles(), strict=True)]
    path = written(tmp_path / "red.csv", "# illuminant: E\ntheta_i,theta_r,phi_r,700nm,550nm,400nm", rows)
    found = tabulated.read(path)
    expected = np.array([0.2, 0.05, 0.05]) @ spectra.rec709_weights([400, 550, 700], "E")
    np.testing.assert_allclose(found.samples.values, np.broadcast_to(expected, found.samples.values.shape))
    one = written(tmp_path / "laser.csv", "theta_i,theta_o,phi,532nm", [row[:4] for row in rows])
    read = tabulated.read(one)
    np.testing.assert_allclose(read.samples.values, 0.05)
    assert "532 nm alone" in read.notes[0]
    narrow = written(tmp_path / "n.csv", "theta_i,theta_o,phi,500,600", [row[:5] for row in rows])
    assert "from 500 to 600 nm" in tabulated.read(narrow).notes[0]


def test_a_file_becomes_a_material(tmp_path: Path) -> None:
    rows = [(*where, 0.1, 0.1, 0.1) for where in zip(*angles(), strict=True)]
    rows.append((10, 95, 0, 1, 1, 1))
    path = written(tmp_path / "chalk.csv", "theta_i,theta_o,phi,R,G,B", rows)
    model = TABULATED.load(path)
    (material,) = model.materials
    assert (material.name, material.model) == ("chalk", "measured")
    np.testing.assert_allclose(material.tables[SLOT].values, 0.1, rtol=1e-4)
    assert model.notes == ("1 samples below the surface or along it were left out.",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no line of columns"),
        ("a,b,c\n1,2,3\n", "no line of columns"),
        ("theta_i,theta_o,500nm\n" + "0,0,1\n" * 20, "no column phi"),
        ("theta_i,theta_o,phi,500nm\n" + "0,0,0,1\n" * 5, "5 samples"),
        ("theta_i,theta_o,phi,500nm\n" + "0,0,0,1\n" * 20 + "0,0,0\n", "line 22 has 3 numbers"),
        ("theta_i,theta_o,phi,500nm\n" + "0,0,0,x\n", "line 2 is not made of numbers"),
        ("theta_i,theta_o,phi,500nm\n" + "0,0,0,nan\n" * 20, "not finite"),
        ("theta_i,theta_o,phi,500nm\n" + "0,0,0,1e20\n" * 20, "no reflectance"),
        ("theta_i,theta_o,phi,gloss\n" + "0,0,0,1\n" * 20, "'gloss' is no wavelength"),
        ("theta_i,theta_o,phi,500nm,500\n" + "0,0,0,1,1\n" * 20, "twice"),
        ("theta_i,theta_o,phi,1550nm\n" + "0,0,0,1\n" * 20, "cannot be seen"),
        ("theta_i,theta_o,phi\n" + "0,0,0\n" * 20, "no values"),
        ("# illuminant: F2\ntheta_i,theta_o,phi,500\n" + "0,0,0,1\n" * 20, "'F2' is unknown"),
        ("# angles: gon\ntheta_i,theta_o,phi,500\n" + "0,0,0,1\n" * 20, "not in 'gon'"),
        ("theta_i,theta_o,phi,500\n" + "120,0,0,1\n" * 20, "lie above the surface"),
        ("VARS theta_i,phi_i,theta_s,phi_s,500nm\n" + "45,0,45,180,1\n" * 20, "read as radians"),
        (
            "NUM_POINTS 99\nVARS theta_i,phi_i,theta_s,phi_s,500nm\n" + "0,0,0,1,1\n" * 20,
            "says 99 samples and has 20",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "odd.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        tabulated.read(path)
    assert "odd.csv cannot be imported: " in str(caught.value)
    assert "\n" not in str(caught.value)


@given(data=st.binary(max_size=300), tail=st.text("0123456789,.-e\n#VARS theta_iophng", max_size=200))
@settings(max_examples=150, deadline=None)
def test_no_bytes_do_harm(tmp_path_factory: pytest.TempPathFactory, data: bytes, tail: str) -> None:
    path = tmp_path_factory.mktemp("any") / "any.csv"
    path.write_bytes(b"theta_i,theta_o,phi,500nm\n" * (len(data) % 2) + data + tail.encode())
    with contextlib.suppress(InputError):
        tabulated.read(path)
