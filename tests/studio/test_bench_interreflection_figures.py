"""The paper's figures 8 and 10: what their curves must do, and the functions that they compare."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from studio.bench import interreflection_figures as figures
from studio.bench.harness import Report
from studio.bench.interreflection_meshes import bunny, slab, star
from studio.bench.plot import Chart, svg
from studio.headless import Headless

SMALL = {"floor": (slab(2.0, 2.0, 0.02, (12, 12)), 0.2), "bunny": (star(15, 20, bunny), 0.3)}


@pytest.fixture(scope="module")
def program():
    return Headless(quiet=True)


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(figures, "OBJECTS", SMALL)


def test_principal_components_are_best_on_a_compact_object(program, small):
    """As the paper found; on a floor cosine series are as good."""
    found = figures.bases("bunny", program.services)
    place = figures.COUNTS.index(16)
    for curves in found.values():
        best = curves[figures.PRINCIPAL][place]
        for kind, errors in curves.items():
            assert list(errors) == sorted(errors, reverse=True)
            assert kind == figures.PRINCIPAL or best < errors[place]
    floor = figures.bases("floor", program.services)["between"]
    assert floor["cosine series"][place] == pytest.approx(floor[figures.PRINCIPAL][place], rel=0.2)
    assert floor["wavelets"][place] > 1.2 * floor[figures.PRINCIPAL][place]


@pytest.mark.parametrize("make", [figures.cosines, figures.wavelets])
def test_functions_over_the_square_are_orthogonal(make):
    u, v = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(64) + 0.5) / 64)
    functions = make(np.stack([u.ravel(), v.ravel()], axis=1), 40)
    gram = functions.T @ functions
    size = np.sqrt(np.diag(gram))
    np.testing.assert_allclose(gram / size / size[:, None], np.eye(40), atol=1e-9)


def test_sharper_lobes_need_more_products(program):
    found = figures.products(program)
    errors = np.array([found[n]["plain"] for n in figures.EXPONENTS])
    assert (np.diff(errors, axis=1) < 1e-6).all()
    assert (np.diff(errors, axis=0) > -1e-3).all()
    kept = np.array([found[n]["energy_kept"] for n in figures.EXPONENTS])
    assert (kept > errors - 0.01).all()


def test_rows_are_reported_by_case(program, small):
    report = Report("interreflection", quick=True, only="figure-8/floor")
    figures.run(report, program, None)
    assert {row.case for row in report.rows} == {"figure-8/floor"}
    assert {row.metric for row in report.rows} >= {"wavelets_16_between", "principal_components_64_off"}


def test_a_chart_is_drawn_within_its_frame():
    charts = [
        Chart("a < b", "x", "y", (1, 2, 4), {"one": (1.0, 0.5, 0.01), "two": (3.0, 2.0, 1.0)}, 100.0, " %"),
        Chart("flat", "x", "y", (1, 10), {"only": (2.0, 2.0)}),
        Chart("third", "x", "y", (1, 10), {"only": (2.0, 7.0)}),
    ]
    root = ElementTree.fromstring(svg(charts))
    assert (root.get("width"), root.get("height")) == ("800", "600")
    space = "{http://www.w3.org/2000/svg}"
    groups = root.findall(f"{space}g")
    assert [len(g.findall(f"{space}circle")) for g in groups] == [6, 2, 2]
    for circle in root.iter(f"{space}circle"):
        assert 0 <= float(circle.get("cx")) <= 400
        assert 0 <= float(circle.get("cy")) <= 300
    assert groups[0].find(f"{space}text").text == "a < b"
