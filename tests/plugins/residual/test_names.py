"""What the names of a set of photographs tell."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from studio_plugins.residual.names import Told, told_by

ROW = [a for a in range(-60, 61, 10) if a]


def signed(minus: str, plus: str) -> Callable[[int], str]:
    return lambda a: f"{minus if a < 0 else plus}{abs(a)}"


@pytest.mark.parametrize(
    "name",
    [
        lambda a: f"az{a}.png",
        lambda a: f"{a}.jpg",
        lambda a: f"cloth{a}.jpg",
        lambda a: f"cloth-{a}.jpg",  # cloth--60 and cloth-60
        lambda a: f"jade_{a:+d}.JPG",
        lambda a: signed("m", "p")(a) + ".tif",
        lambda a: signed("minus", "")(a) + ".png",
        lambda a: signed("cloth_minus_", "cloth_")(a) + ".png",
        lambda a: signed("n", "")(a) + ".png",
        lambda a: signed("cloth \u2212", "cloth ")(a) + ".png",
        lambda a: signed("L", "R")(a) + ".jpg",
        lambda a: signed("left", "right")(a) + ".jpg",
        lambda a: f"ball1_{a}.jpg",
        lambda a: f"2024-05-12_{a}.jpg",
        lambda a: f"{a}deg.jpg",
        lambda a: f"light_{a}/IMG_{4711 + ROW.index(a)}.JPG",
        lambda a: signed("m", "p")(a) + "/x.jpg",
        lambda a: f"{(a + 360) % 360:03}.jpg",
    ],
)
def test_azimuths_in_all_the_ways_people_write_them(name: Callable[[int], str]) -> None:
    assert [one.azimuth for one in told_by([name(a) for a in ROW])] == ROW


@pytest.mark.parametrize(
    ("name", "told"),
    [
        (lambda a, k: f"{a}/{k}.jpg", lambda k: Told(number=k)),
        (lambda a, k: f"{k}/{a}.jpg", lambda k: Told(number=k)),
        (lambda a, k: f"exp{k}/{a}.jpg", lambda k: Told(number=k)),
        (lambda a, k: f"jade_{a}_{k}.jpg", lambda k: Told(number=k)),
        (lambda a, k: f"az{a}_e{k}.jpg", lambda k: Told(number=k)),
        (lambda a, k: f"az{a}_t{2**k}.jpg", lambda k: Told(seconds=2**k)),
        (lambda a, k: f"az{a}_t1-{2**k}.jpg", lambda k: Told(seconds=0.5**k)),
        (lambda a, k: f"{a}_1_{2**k}s.jpg", lambda k: Told(seconds=0.5**k)),
        (lambda a, k: f"{a}_{30 * k}ms.jpg", lambda k: Told(seconds=0.03 * k)),
        (lambda a, k: f"{a}_ev{2 * k - 6:+d}.jpg", lambda k: Told(ev=2 * k - 6)),
    ],
)
def test_exposures_in_names(name: Callable[[int, int], str], told: Callable[[int], Told]) -> None:
    pairs = [(a, k) for a in ROW for k in range(1, 6)]
    for (azimuth, k), one in zip(pairs, told_by([name(a, k) for a, k in pairs]), strict=True):
        wanted = told(k)
        assert (one.azimuth, one.number, one.ev) == (azimuth, wanted.number, wanted.ev)
        assert one.seconds == pytest.approx(wanted.seconds)


def test_two_angles() -> None:
    pairs = [(a, h) for a in ROW for h in (-40, 0, 40)]
    for name in ("{}_{}.png", "az{}_el{}.png", "phi{}-h{}.png", "{1}/{0}.png"):
        told = told_by([name.format(a, h) for a, h in pairs])
        found = [(one.azimuth, one.height) for one in told]
        assert found == pairs or (name == "{1}/{0}.png" and found == pairs)


@pytest.mark.parametrize(
    "names", [[f"DSC_{i:04}.jpg" for i in range(1, 13)], [f"{i}.jpg" for i in range(12)]]
)
def test_numbers_that_count_are_no_directions(names: list[str]) -> None:
    assert all(one.azimuth is None for one in told_by(names))
