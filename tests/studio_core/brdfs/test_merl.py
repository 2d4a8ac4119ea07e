"""MERL files: bit for bit in layout, and refused where they are damaged."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from oracles import merl as oracle
from oracles.brdf import ggx

from studio_core.brdfs import merl
from studio_core.brdfs.half_difference import grid
from studio_core.errors import InputError

F64 = npt.NDArray[np.float64]
VALUES = {"base_color": (0.7, 0.3, 0.1), "metallic": 0.4, "roughness": 0.45, "specular": 0.5}


@pytest.fixture(scope="module")
def analytic() -> tuple[F64, npt.NDArray[np.bool_]]:
    """(90, 90, 180, 3) of a glossy material, and which cells lie above the surface."""
    wi, wo = grid(merl.SHAPE)
    known = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    made = np.zeros((*merl.SHAPE, 3))
    made[known] = ggx(VALUES, wo[known], wi[known])
    return made, known


def test_layout_is_the_databases(tmp_path: Path, analytic: tuple[F64, npt.NDArray[np.bool_]]) -> None:
    values, known = analytic
    path = tmp_path / "glossy.binary"
    merl.write(path, values, known)
    data = path.read_bytes()
    assert len(data) == 12 + 3 * 90 * 90 * 180 * 8
    assert struct.unpack_from("<3i", data) == (90, 90, 180)
    wi, wo = grid(merl.SHAPE)
    rng = np.random.default_rng(3)
    for i, j, k in rng.integers(0, merl.SHAPE, (400, 3)):
        if not known[i, j, k]:
            place = k + 180 * (j + 90 * i)
            assert struct.unpack_from("<d", data, 12 + 8 * place)[0] == -1
            continue
        place = oracle.index(tuple(wi[i, j, k]), tuple(wo[i, j, k]))
        truth = ggx(VALUES, wo[i, j, k][None], wi[i, j, k][None])[0]
        for channel, scale in enumerate((1 / 1500, 1.15 / 1500, 1.66 / 1500)):
            at = 12 + 8 * (place + channel * 90 * 90 * 180)
            assert struct.unpack_from("<d", data, at)[0] == pytest.approx(truth[channel] / scale, rel=1e-9)
    found = merl.read(path)
    np.testing.assert_allclose(found.table.values[known], values[known], rtol=1e-6)
    assert found.invalid == 0
    assert found.table.name == "glossy"
    holes = known.copy()
    holes[:, ::10] = False
    merl.write(path, values, holes)
    assert merl.read(path).invalid == pytest.approx(1 - holes[known].mean())
    again = tmp_path / "again.binary"
    merl.write(again, np.where(known[..., None], found.table.values, 0), known)
    assert merl.read(again).table.key == found.table.key


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bad.binary"
    whole = np.full((3, *merl.SHAPE), 1.0)

    def refused(data: bytes, words: str) -> None:
        path.write_bytes(data)
        with pytest.raises(InputError, match=words) as caught:
            merl.read(path)
        assert "bad.binary" in str(caught.value)
        assert "\n" not in str(caught.value)

    head = struct.pack("<3i", 90, 90, 180)
    refused(b"", "has 0")
    refused(head, "has 12")
    refused(struct.pack("<3i", 2_000_000_000, 2, 2) + b"\0" * 64, "begins with 2000000000 × 2 × 2")
    refused(head + whole.tobytes()[:-8], "has 34992004")
    refused(head + whole.tobytes() + b"x", "has 34992013")
    refused(struct.pack("<3i", 90, 180, 90) + whole.tobytes(), "90 × 180 × 90")
    refused(struct.pack(">3i", 90, 90, 180) + whole.tobytes(), "begins with")
    refused(head + (whole * -1).tobytes(), "none of its values")
    refused(head + (whole * 1e30).tobytes(), "no reflectance")
    whole[1, 4, 5, 6] = np.nan
    refused(head + whole.tobytes(), "not finite")
    for none in (tmp_path / "none.binary", tmp_path):
        with pytest.raises(InputError, match="no such file"):
            merl.read(none)
