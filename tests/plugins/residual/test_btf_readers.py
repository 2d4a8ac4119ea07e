"""BTFs in folders, zip files and Bonn's `.btf` files come back as they were; what is damaged is said."""

from __future__ import annotations

import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio.bench.lab_btf import ClothBtf, Weave
from studio.bench.lab_btf_files import (
    LOGARITHMS,
    NAMES,
    PCA,
    RATIOS,
    RGB,
    YUV_MODEL,
    write_factored,
    write_pictures,
)
from studio_core.errors import InputError
from studio_plugins.residual.btf import Btf, directions, hemisphere_81, is_btf, open_btf, unique_directions
from studio_plugins.residual.btf_pictures import angles_of

SOME = np.array([(0, 0), (15, 60), (45, 200), (60, 300)], float)


@cache
def cloth(bits: int = 0, texels: int = 16) -> ClothBtf:
    made = directions(np.radians(SOME[:, 0]), np.radians(SOME[:, 1]))
    return ClothBtf(Weave(texels=texels, yarns=2, height=0.05), made, bits, full=1.0)


def everything(btf: Btf) -> np.ndarray:
    return np.concatenate([block.values for block in btf.blocks(np.arange(len(btf.lights)))])


def same(read: Btf, made: ClothBtf, tolerance: float) -> None:
    order = [
        int(np.argmax(read.lights @ light + read.views @ view))
        for light, view in zip(made.lights, made.views, strict=True)
    ]
    assert sorted(order) == list(range(len(made.lights)))
    assert np.allclose(read.lights[order], made.lights, atol=1e-6)
    assert np.allclose(read.views[order], made.views, atol=1e-6)
    assert read.size == made.size
    found, wanted = everything(read)[order], everything(made)
    assert np.abs(found - wanted).max() <= tolerance


@pytest.mark.parametrize("names", NAMES)
def test_folders_in_all_ways_of_naming(tmp_path: Path, names: str) -> None:
    write_pictures(cloth(), tmp_path, "exr", names)
    assert is_btf(tmp_path)
    same(open_btf(tmp_path), cloth(), 0.0)


def test_zip_files_stay_packed(tmp_path: Path) -> None:
    path = tmp_path / "UBO_CLOTH.zip"
    write_pictures(cloth(8), path, "png")
    with zipfile.ZipFile(path, "a") as more:
        more.writestr("readme.txt", "no picture")
        more.writestr("preview.png", b"")
    read = open_btf(path)
    same(read, cloth(8), 1e-6)
    assert "1 pictures are left out" in read.notes[0]
    blocks = list(read.blocks(np.array([5, 2])))
    assert [b.indices.tolist() for b in blocks] == [[5, 2]]


@pytest.mark.parametrize(
    ("signature", "model"),
    [
        *((b"!DFMF08FCR", m) for m in (RGB, YUV_MODEL, PCA, RATIOS, LOGARITHMS)),
        (b"!FMF12FCER", 0),
        (b"!FMF06FCR", 0),
        (b"!FMF06FC", 0),
    ],
)
@pytest.mark.parametrize("swapped", [False, True])
def test_factored_files(tmp_path: Path, signature: bytes, model: int, swapped: bool) -> None:
    made = cloth(texels=18)
    path = tmp_path / "cloth.btf"
    write_factored(made, path, signature=signature, model=model, scalar=4, swapped=swapped)
    same(open_btf(path), made, 2e-4)


@pytest.mark.parametrize(("version", "scalar", "cosine"), [(1, 2, False), (2, 8, False), (3, 2, True)])
def test_versions_of_factored_files(tmp_path: Path, version: int, scalar: int, cosine: bool) -> None:
    path = tmp_path / "cloth.btf"
    write_factored(cloth(), path, version=version, scalar=scalar, cosine=cosine)
    same(open_btf(path), cloth(), 4e-3 if scalar == 2 else 1e-6)


@cache
def factored() -> bytes:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.btf"
        write_factored(cloth(), path)
        return path.read_bytes()


@given(st.data())
def test_damaged_factored_files_are_refused(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    whole = bytearray(factored())
    header = 700
    at = data.draw(st.integers(0, header))
    if data.draw(st.booleans()):
        whole = whole[: data.draw(st.integers(0, len(whole) - 1))]
    else:
        whole[at : at + 4] = data.draw(st.binary(min_size=4, max_size=4))
    path = tmp_path_factory.mktemp("damaged") / "a.btf"
    path.write_bytes(bytes(whole))
    try:
        read = open_btf(path)
    except InputError as error:
        assert "a.btf" in str(error)
        return
    assert np.isfinite(read.lights).all()
    if read.size == (16, 16):
        assert np.isfinite(everything(read)).all()


@pytest.mark.parametrize(
    ("name", "data", "why"),
    [
        ("a.btf", b"", "no BTF file"),
        ("a.btf", b"!PVF06FCR" + bytes(99), "a kind that is not understood"),
        ("a.zip", b"PK nothing", "no zip file"),
        ("b.btf", None, "no such file"),
    ],
)
def test_what_is_no_btf_is_said(tmp_path: Path, name: str, data: bytes | None, why: str) -> None:
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=why):
        open_btf(tmp_path / name)


def test_damaged_pictures_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.zip"
    write_pictures(cloth(), path, "png", "utia")
    data = bytearray(path.read_bytes())
    at = data.index(b"tl015_pl060_tv000_pv000.png") + 60
    data[at : at + 20] = bytes(20)
    path.write_bytes(bytes(data))
    read = open_btf(path)
    with pytest.raises(InputError, match=r"tl015_pl060_tv000_pv000\.png"):
        everything(read)
    folder = tmp_path / "folder"
    write_pictures(cloth(), folder, "exr", "utia")
    write_pictures(cloth(texels=20), folder / "x", "exr", "utia")
    (folder / "x/tl000_pl000_tv060_pv300.exr").replace(folder / "tl000_pl000_tv060_pv300.exr")
    for path in (folder / "x").iterdir():
        path.unlink()
    with pytest.raises(InputError, match="20 × 20 pixels, others are 16 × 16"):
        everything(open_btf(folder))


def test_photographs_are_no_btf(tmp_path: Path) -> None:
    for i in range(20):
        (tmp_path / f"az{i}_el0.png").write_bytes(b"")
    assert not is_btf(tmp_path)
    with pytest.raises(InputError, match="do not name a light and a view"):
        open_btf(tmp_path)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("tv030_pv060/00008 tl015 pl120 tv030 pv060.jpg", (15, 120, 30, 60)),
        ("img_tv0_pv0_tl15_pl0.jpg", (15, 0, 0, 0)),
        ("15_120_30_60.png", (15, 120, 30, 60)),
        ("30_60/15_120.png", (15, 120, 30, 60)),
        ("tl95_pl0_tv0_pv0.png", None),
        ("tl15_pl0.png", None),
        ("IMG_0001.jpg", None),
    ],
)
def test_names(name: str, told: tuple[float, ...] | None) -> None:
    assert angles_of(name) == told


def test_bonns_hemisphere() -> None:
    every = hemisphere_81()
    assert len(unique_directions(every)[0]) == 81
    assert np.allclose(np.linalg.norm(every, axis=1), 1)
    assert every[:, 2].min() == pytest.approx(np.cos(np.radians(75)))
