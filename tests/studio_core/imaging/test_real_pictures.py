"""Pictures made by others: every file opens, or is refused in one sentence that names it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from studio_core.errors import InputError
from studio_core.imaging.environment import load_environment
from studio_core.imaging.io import ImageDecoder
from studio_core.imaging.latlong import pixel_directions, pixel_solid_angles
from studio_core.imaging.resample import resize_area


@pytest.fixture(scope="module")
def decoder() -> Iterator[ImageDecoder]:
    with ImageDecoder(timeout=60) as made:
        yield made


def attempt(decoder: ImageDecoder, path: Path) -> bool:
    try:
        pixels = decoder.read(path).pixels
    except InputError as error:
        assert path.name in str(error)
        assert "\n" not in str(error)
        assert "crash" not in str(error)
        return False
    assert pixels.size
    return True


def test_damaged_exr_files_are_refused(shared_data: Path, decoder: ImageDecoder) -> None:
    folder = shared_data / "third_party/openexr_edge/Damaged"
    paths = [path for path in folder.iterdir() if path.is_file()]
    assert len(paths) >= 30
    assert sum(attempt(decoder, path) for path in paths) == 0


def test_odd_exr_files_open_but_for_known_ones(shared_data: Path, decoder: ImageDecoder) -> None:
    folder = shared_data / "third_party/openexr_edge"
    refused = {path.name for path in folder.rglob("*.exr") if not attempt(decoder, path)}
    outside = {"t09.exr", "t10.exr", "t11.exr", "t12.exr"}  # nothing of them is in the display window
    assert refused == {"Rec709_YC.exr", *outside}


def test_radiance_pictures_and_photographs_open(shared_data: Path, decoder: ImageDecoder) -> None:
    paths = [*(shared_data / "third_party/radiance_bsd").glob("*.hdr")]
    paths += (shared_data / "third_party").rglob("*.jpg")
    paths += (shared_data / "cc0").rglob("*.jpg")
    assert len(paths) > 10
    assert sum(attempt(decoder, path) for path in paths) == len(paths)


def test_xyz_and_rec709_are_one_picture(shared_data: Path, decoder: ImageDecoder) -> None:
    folder = shared_data / "third_party/openexr_edge"
    ours, theirs = (decoder.read(folder / f"{name}.exr").pixels for name in ("XYZ", "Rec709"))
    assert np.sqrt(((ours - theirs) ** 2).mean()) / theirs.mean() < 2e-3


def test_poly_haven_maps_light_a_scene(shared_data: Path, decoder: ImageDecoder) -> None:
    paths = list((shared_data / "cc0/hdri_polyhaven_cc0").glob("*.exr"))
    assert paths
    for path in paths:
        image, _ = load_environment(path, decoder)
        assert image.pixels.shape == (512, 1024, 3)
        assert np.isfinite(image.pixels).all()
        assert image.pixels.min() >= 0


def irradiance(pixels: np.ndarray, normals: np.ndarray) -> np.ndarray:
    height, width = pixels.shape[:2]
    weighted = pixels * pixel_solid_angles(height, width)[:, None, None]
    cosines = np.maximum(pixel_directions(height, width).reshape(-1, 3) @ normals.T, 0)
    made: np.ndarray = cosines.T @ weighted.reshape(-1, 3)
    return made


@pytest.mark.parametrize("name", ["KernerEnv", "Orientation"])
def test_cube_and_lat_long_of_a_scene_agree(shared_data: Path, decoder: ImageDecoder, name: str) -> None:
    folder = shared_data / "third_party/openexr_env"
    cube, latlong = (
        load_environment(folder / f"{name}{kind}.exr", decoder)[0] for kind in ("Cube", "LatLong")
    )
    normals = np.random.default_rng(3).normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ours, theirs = (irradiance(resize_area(p.pixels, 256, 512), normals) for p in (cube, latlong))
    np.testing.assert_allclose(ours, theirs, rtol=0.01)
    small = [np.minimum(resize_area(np.minimum(p.pixels, 1), 32, 64), 1) for p in (cube, latlong)]
    assert np.sqrt(((small[0] - small[1]) ** 2).mean()) / small[1].mean() < 0.05
