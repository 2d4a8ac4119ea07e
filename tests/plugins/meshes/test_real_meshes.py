"""Models made by others: every file opens, or is refused in one sentence that names it."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from studio_core.contract import ImportedModel, Importer
from studio_core.errors import InputError
from studio_core.scene.size import model_size, suspicious_size
from studio_plugins.meshes.gltf import IMPORTER as GLTF
from studio_plugins.meshes.obj import IMPORTER as OBJ


def attempt(importer: Importer, path: Path) -> ImportedModel | None:
    try:
        model = importer.load(path)
    except InputError as error:
        assert path.name in str(error)
        assert "\n" not in str(error)
        return None
    assert model.objects or model.materials
    return model


def test_the_furniture_has_its_proportions_and_pictures(shared_data: Path) -> None:
    folder = shared_data / "cc0/furniture_blendswap_cc0"
    rows = list(csv.DictReader((folder / "catalog.tsv").read_text().splitlines(), delimiter="\t"))
    assert len(rows) == 20
    stretched = []
    for row in rows:
        model = attempt(OBJ, folder / row["path"])
        assert model is not None, row["path"]
        size = np.array(model_size(model))
        wanted = np.array([float(row[key]) for key in ("width_cm", "depth_cm", "height_cm")])
        ratio = wanted / size
        if ratio.max() / ratio.min() > 1.005:
            stretched.append(row["name"])
        assert not any("missing" in note for note in model.notes)
    assert stretched == ["Bed", "Grand piano"]  # the catalogue shows these two stretched


def test_catalogue_sizes_are_asked_about(shared_data: Path) -> None:
    path = shared_data / "cc0/furniture_blendswap_cc0/sofa2/sofa2.obj"
    question = suspicious_size(OBJ.load(path))
    assert question is not None
    assert "167 × 74.7 × 84.8 m" in question
    assert "centimetres" in question
    assert suspicious_size(OBJ.load(path, 0.01)) is None


def test_obj_edge_cases(shared_data: Path) -> None:
    paths = sorted((shared_data / "third_party/obj_edge_tinyobj_mit").rglob("*.obj"))
    assert len(paths) >= 47
    refused = {path.stem for path in paths if attempt(OBJ, path) is None}
    assert refused == {
        "invalid-face-definition",
        "invalid-relative-texture-index",
        "invalid-relative-vertex-index",
        "issue-356-leading-spaces-newmtl",  # no faces at all
        "line-prim",
        "points-prim",
    }


@pytest.mark.parametrize(
    ("path", "faces"),
    [("spot_cc0", 5856), ("teapot", 6320), ("cornell_box_pd", 32)],
)
def test_well_known_meshes(shared_data: Path, path: str, faces: int) -> None:
    (file,) = (shared_data / "third_party" / path).glob("*.obj")
    model = attempt(OBJ, file)
    assert model is not None
    assert sum(len(node.geometry.faces) for node in model.objects) == faces


def test_valid_gltf_files_open(shared_data: Path) -> None:
    folder = shared_data / "third_party/gltf_valid_ccby"
    paths = [*folder.glob("*.glb"), *folder.glob("*.gltf")]
    refused = {path.name for path in paths if attempt(GLTF, path) is None}
    assert refused == {"empty_nodes.glb", "Mesh_PrimitiveMode_04.gltf"}  # no mesh; no .bin beside it
    truck = GLTF.load(folder / "CesiumMilkTruck.glb")
    assert len({id(node.geometry) for node in truck.objects}) == 2
    assert len(truck.objects) == 3  # both axles have one pair of wheels


def test_validator_files_open_or_are_refused(shared_data: Path) -> None:
    folder = shared_data / "third_party/gltf_validator_apache2"
    paths = [path for path in folder.rglob("*") if path.suffix in (".gltf", ".glb")]
    assert len(paths) >= 90
    for path in paths:
        attempt(GLTF, path)


def test_compressed_meshes_are_refused_by_name(shared_data: Path) -> None:
    with pytest.raises(InputError, match=r"suzi\.glb.*draco"):
        GLTF.load(shared_data / "cc0/meshes_cc0/suzi.glb")
