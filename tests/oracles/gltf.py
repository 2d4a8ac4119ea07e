"""The rules of glTF 2.0 that a written GLB must hold (specification 3.6–3.9, 4.4, 5.*)."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

SIZES = {5121: 1, 5123: 2, 5125: 4, 5126: 4}
TYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
TOP = (
    "nodes",
    "meshes",
    "materials",
    "textures",
    "images",
    "samplers",
    "cameras",
    "accessors",
    "bufferViews",
)


def parse(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Document and binary chunk, after checking the container."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<II", data, 12)
    assert kind == 0x4E4F534A
    assert size % 4 == 0
    document = json.loads(data[20 : 20 + size])
    at = 20 + size
    if at == len(data):
        return document, b""
    binary, kind = struct.unpack_from("<II", data, at)
    assert kind == 0x004E4942
    assert binary % 4 == 0
    assert at + 8 + binary == len(data)
    return document, data[at + 8 :]


def read(document: dict[str, Any], binary: bytes, accessor: int) -> Any:
    """An accessor's values (N, width)."""
    made = document["accessors"][accessor]
    view = document["bufferViews"][made["bufferView"]]
    width = WIDTHS[made["type"]]
    offset = view["byteOffset"] + made.get("byteOffset", 0)
    return np.frombuffer(binary, TYPES[made["componentType"]], made["count"] * width, offset).reshape(
        -1, width
    )


def check(document: dict[str, Any], binary: bytes) -> None:
    """Assert what a validator would."""
    assert document["asset"]["version"] == "2.0"
    for name in TOP:
        assert document.get(name, [None]), f"{name} is empty"
    if binary:
        assert document["buffers"][0]["byteLength"] <= len(binary) <= document["buffers"][0]["byteLength"] + 3
    for view in document.get("bufferViews", []):
        assert view["byteOffset"] + view["byteLength"] <= len(binary)
        assert view["byteLength"] > 0
    for accessor in document.get("accessors", []):
        size = SIZES[accessor["componentType"]]
        view = document["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        assert accessor["count"] * size * WIDTHS[accessor["type"]] <= view["byteLength"]
    for mesh in document.get("meshes", []):
        assert mesh["primitives"]
        for primitive in mesh["primitives"]:
            _primitive(document, binary, primitive)
    _nodes(document)
    used = set(document.get("extensionsUsed", []))
    assert used == set(_extensions(document)), used
    for texture in document.get("textures", []):
        assert texture["source"] < len(document["images"])
        assert texture["sampler"] < len(document["samplers"])
    for image in document.get("images", []):
        view = document["bufferViews"][image["bufferView"]]
        assert "target" not in view
        assert binary[view["byteOffset"] :][:8] == b"\x89PNG\r\n\x1a\n"
    for material in document.get("materials", []):
        factor = material["pbrMetallicRoughness"]["baseColorFactor"]
        assert len(factor) == 4
        assert all(0 <= f <= 1 for f in factor)
        for name in ("metallicFactor", "roughnessFactor"):
            assert 0 <= material["pbrMetallicRoughness"][name] <= 1


def _primitive(document: dict[str, Any], binary: bytes, primitive: dict[str, Any]) -> None:
    attributes = primitive["attributes"]
    positions = read(document, binary, attributes["POSITION"])
    accessor = document["accessors"][attributes["POSITION"]]
    np.testing.assert_array_equal(np.float32(accessor["min"]), positions.min(axis=0))
    np.testing.assert_array_equal(np.float32(accessor["max"]), positions.max(axis=0))
    for name, index in attributes.items():
        assert document["accessors"][index]["count"] == len(positions), name
        assert document["bufferViews"][document["accessors"][index]["bufferView"]]["target"] == 34962
    normals = read(document, binary, attributes["NORMAL"])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-4)
    indices = read(document, binary, primitive["indices"])
    assert len(indices) % 3 == 0
    assert indices.max() < len(positions)
    kind = document["accessors"][primitive["indices"]]["componentType"]
    assert indices.max() < {5123: 65535, 5125: 4294967295}[kind]
    assert (
        document["bufferViews"][document["accessors"][primitive["indices"]]["bufferView"]]["target"] == 34963
    )
    assert primitive["material"] < len(document["materials"])


def _nodes(document: dict[str, Any]) -> None:
    nodes = document.get("nodes", [])
    parents = [child for node in nodes for child in node.get("children", [])]
    roots = document["scenes"][document["scene"]].get("nodes", [])
    assert sorted(parents + roots) == list(range(len(nodes))), "each node has one parent or is a root"
    lights = document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    for node in nodes:
        if "rotation" in node:
            assert abs(np.linalg.norm(node["rotation"]) - 1) < 1e-5
        assert node.get("mesh", -1) < len(document.get("meshes", []))
        assert node.get("camera", -1) < len(document.get("cameras", []))
        light = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light", -1)
        assert light < len(lights)
    for light in lights:
        assert light["intensity"] >= 0
        assert max(light["color"]) <= 1
        if light["type"] == "spot":
            spot = light["spot"]
            assert 0 <= spot["innerConeAngle"] < spot["outerConeAngle"] <= np.pi / 2


def _extensions(value: Any) -> list[str]:
    if isinstance(value, list):
        return [name for item in value for name in _extensions(item)]
    if isinstance(value, dict):
        here = list(value.get("extensions", {}))
        return here + [name for item in value.values() for name in _extensions(item)]
    return []
