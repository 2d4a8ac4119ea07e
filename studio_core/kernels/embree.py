"""Embree 4 through ctypes: the library that the embreex wheel brings, with instances and packets.

embreex itself offers neither instances nor packets nor addresses, so its library is loaded directly.
Calls through ctypes release the interpreter lock, building included. Objects free what they hold when
they are closed or forgotten; a scene keeps its meshes alive and a mesh its device.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys
import weakref
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.errors import LucarneError
from studio_core.kernels import packets

_TRIANGLE, _INSTANCE = 0, 121
_INDEX_BUFFER, _VERTEX_BUFFER = 0, 1
_UINT3, _FLOAT3, _FLOAT3X4_COLUMN_MAJOR = 0x5003, 0x9003, 0x9234
_ROBUST = 1 << 2
_VERSION_MAJOR, _RAY_MASK_SUPPORTED = 1, 64

_pointer, _uint, _int = ctypes.c_void_p, ctypes.c_uint, ctypes.c_int
_FUNCTIONS: dict[str, tuple[type | None, tuple[type, ...]]] = {
    "rtcNewDevice": (_pointer, (ctypes.c_char_p,)),
    "rtcReleaseDevice": (None, (_pointer,)),
    "rtcGetDeviceError": (_int, (_pointer,)),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, (_pointer, _int)),
    "rtcNewScene": (_pointer, (_pointer,)),
    "rtcReleaseScene": (None, (_pointer,)),
    "rtcSetSceneFlags": (None, (_pointer, _int)),
    "rtcCommitScene": (None, (_pointer,)),
    "rtcNewGeometry": (_pointer, (_pointer, _int)),
    "rtcReleaseGeometry": (None, (_pointer,)),
    "rtcCommitGeometry": (None, (_pointer,)),
    "rtcEnableGeometry": (None, (_pointer,)),
    "rtcDisableGeometry": (None, (_pointer,)),
    "rtcSetGeometryMask": (None, (_pointer, _uint)),
    "rtcSetNewGeometryBuffer": (_pointer, (_pointer, _int, _uint, _int, ctypes.c_size_t, ctypes.c_size_t)),
    "rtcAttachGeometryByID": (None, (_pointer, _pointer, _uint)),
    "rtcGetGeometry": (_pointer, (_pointer, _uint)),
    "rtcSetGeometryInstancedScene": (None, (_pointer, _pointer)),
    "rtcSetGeometryTimeStepCount": (None, (_pointer, _uint)),
    "rtcSetGeometryTransform": (None, (_pointer, _uint, _int, _pointer)),
    "rtcOccluded8": (None, (_pointer, _pointer, _pointer, _pointer)),
    "rtcIntersect8": (None, (_pointer, _pointer, _pointer, _pointer)),
}


class EmbreeUnavailableError(LucarneError):
    """The wheel's library is missing or is not what we expect; the message says which."""


def find_library() -> Path:
    """The libembree4 of the embreex wheel: auditwheel, delocate and delvewheel each put it elsewhere."""
    found = importlib.util.find_spec("embreex")
    if found is None or not found.submodule_search_locations:
        raise EmbreeUnavailableError("the embreex package is not installed")
    package = Path(next(iter(found.submodule_search_locations)))
    for folder in (package.parent / "embreex.libs", package / ".dylibs", package / ".libs", package):
        for pattern in ("libembree4*", "embree4*.dll"):
            matches = sorted(folder.glob(pattern))
            if matches:
                return matches[0]
    raise EmbreeUnavailableError(f"the embreex package in {package} holds no embree 4 library")


def load_library(path: Path) -> ctypes.CDLL:
    """The library with typed functions; a missing symbol is an `EmbreeUnavailableError`."""
    try:
        if sys.platform == "win32":
            with os.add_dll_directory(str(path.parent)):
                library = ctypes.CDLL(str(path))
        else:
            library = ctypes.CDLL(str(path))
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise EmbreeUnavailableError(f"embree could not be loaded: {error}") from error
    return library


class EmbreeDevice:
    """One embree device; makes meshes and scenes. Raises `EmbreeUnavailableError`."""

    name = "embree"

    def __init__(self, path: Path | None = None):
        self.library = load_library(path or find_library())
        self.pointer = self.library.rtcNewDevice(b"set_affinity=0,start_threads=0")
        if not self.pointer:
            raise EmbreeUnavailableError(
                f"embree refused this processor (error {self.library.rtcGetDeviceError(None)})"
            )
        self._release = weakref.finalize(self, self.library.rtcReleaseDevice, self.pointer)
        self.occluded8 = _address(self.library.rtcOccluded8)
        self.intersect8 = _address(self.library.rtcIntersect8)
        if self.library.rtcGetDeviceProperty(self.pointer, _VERSION_MAJOR) != 4:
            raise EmbreeUnavailableError("the library is not embree 4")
        if not self.library.rtcGetDeviceProperty(self.pointer, _RAY_MASK_SUPPORTED):
            raise EmbreeUnavailableError("the embree library was built without ray masks")
        self._check_layout()

    def check(self, what: str) -> None:
        """Raises when embree reported an error since the last call."""
        error = self.library.rtcGetDeviceError(self.pointer)
        if error == 4:
            raise LucarneError(f"there is not enough memory to build {what}")
        if error:
            raise LucarneError(f"embree could not build {what} (error {error})")

    def mesh(
        self, positions: npt.NDArray[np.float32], faces: npt.NDArray[np.uint32], opaque: int
    ) -> EmbreeMesh:
        """Builds the acceleration structure of a mesh whose first `opaque` faces are opaque."""
        return EmbreeMesh(self, positions, faces, opaque)

    def scene(
        self, meshes: Sequence[EmbreeMesh | None], transforms: Sequence[npt.NDArray[np.float64] | None]
    ) -> EmbreeScene:
        """Places meshes by 3×4 matrices; a None leaves its number unused."""
        return EmbreeScene(self, meshes, transforms)

    def alone(self, mesh: EmbreeMesh) -> EmbreeAlone:
        """The mesh for many rays: no instance stands between, and edges may leak a ray in a million."""
        return EmbreeAlone(mesh)

    def _check_layout(self) -> None:
        """Traces one packet: a library with another packet layout must not be used."""
        positions = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0]], np.float32)
        mesh = self.mesh(positions, np.array([[0, 1, 2]], np.uint32), 1)
        place = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2]])
        scene = self.scene([None, mesh], [None, place])
        packet, valid = _new_packet()
        words = packet.view(np.uint32)
        packet[packets.ORIGIN : packets.ORIGIN + 2] = np.array([[1.0], [0.5]])
        packet[packets.DIRECTION + 2] = np.where(np.arange(8) % 2 == 0, 1.0, -1.0)
        packet[packets.TFAR] = 10.0
        words[packets.MASK] = packets.EVERYTHING
        words[packets.PRIMITIVE : packets.ROWS] = packets.NO_HIT
        self.library.rtcIntersect8(valid.ctypes.data, scene.pointer, packet.ctypes.data, None)
        scene.close()
        hit = packet[:, 0]
        found = (*hit[[packets.TFAR, packets.U, packets.V]], *words[17:20, 0])
        if (
            found != (2.0, 0.25, 0.125, 0, 0, 1)
            or not (words[packets.GEOMETRY, 1::2] == packets.NO_HIT).all()
        ):
            raise EmbreeUnavailableError("the embree library lays out its ray packets differently")


class EmbreeMesh:
    """A mesh and its acceleration structure: geometry 0 holds the opaque faces, 1 the others."""

    def __init__(
        self,
        device: EmbreeDevice,
        positions: npt.NDArray[np.float32],
        faces: npt.NDArray[np.uint32],
        opaque: int,
    ):
        self.device = device
        library = device.library
        self.pointer = library.rtcNewScene(device.pointer)
        device.check("a mesh")
        self._release = weakref.finalize(self, library.rtcReleaseScene, self.pointer)
        library.rtcSetSceneFlags(self.pointer, _ROBUST)
        self.parts: list[int] = []
        parts = ((faces[:opaque], packets.OPAQUE), (faces[opaque:], packets.SEE_THROUGH))
        for number, (part, mask) in enumerate(parts):
            if len(part):
                self._attach(number, positions, part, mask)
                self.parts.append(number)
        library.rtcCommitScene(self.pointer)
        device.check("a mesh")

    def _attach(
        self, number: int, positions: npt.NDArray[np.float32], faces: npt.NDArray[np.uint32], mask: int
    ) -> None:
        library = self.device.library
        geometry = library.rtcNewGeometry(self.device.pointer, _TRIANGLE)
        self.device.check("a mesh")
        try:
            for kind, form, array in (
                (_VERTEX_BUFFER, _FLOAT3, np.ascontiguousarray(positions, np.float32)),
                (_INDEX_BUFFER, _UINT3, np.ascontiguousarray(faces, np.uint32)),
            ):
                target = library.rtcSetNewGeometryBuffer(geometry, kind, 0, form, 12, len(array))
                self.device.check("a mesh")
                ctypes.memmove(target, array.ctypes.data, array.nbytes)
            library.rtcSetGeometryMask(geometry, mask)
            library.rtcCommitGeometry(geometry)
            library.rtcAttachGeometryByID(self.pointer, geometry, number)
        finally:
            library.rtcReleaseGeometry(geometry)


class EmbreeAlone:
    """A mesh in a second acceleration structure over the same geometry, built when it is first asked for.

    Without embree's robust mode it takes a fifth less time.
    """

    def __init__(self, mesh: EmbreeMesh):
        self._mesh = mesh
        self._pointer = 0

    @property
    def pointer(self) -> int:
        """The scene's address."""
        if not self._pointer:
            mesh = self._mesh
            library = mesh.device.library
            made = library.rtcNewScene(mesh.device.pointer)
            mesh.device.check("a mesh")
            self._release = weakref.finalize(self, library.rtcReleaseScene, made)
            for number in mesh.parts:
                library.rtcAttachGeometryByID(made, library.rtcGetGeometry(mesh.pointer, number), number)
            library.rtcCommitScene(made)
            mesh.device.check("a mesh")
            self._pointer = made
        return self._pointer


class EmbreeScene:
    """Instances of meshes; `pointer` stays the same when they move. Don't move while others trace."""

    def __init__(
        self,
        device: EmbreeDevice,
        meshes: Sequence[EmbreeMesh | None],
        transforms: Sequence[npt.NDArray[np.float64] | None],
    ):
        self.device, self.meshes = device, tuple(meshes)
        library = device.library
        self.pointer = library.rtcNewScene(device.pointer)
        device.check("the scene")
        self._release = weakref.finalize(self, library.rtcReleaseScene, self.pointer)
        library.rtcSetSceneFlags(self.pointer, _ROBUST)
        self._instances: dict[int, int] = {}
        for number, (mesh, transform) in enumerate(zip(self.meshes, transforms, strict=True)):
            if mesh is None:
                continue
            geometry = library.rtcNewGeometry(device.pointer, _INSTANCE)
            device.check("the scene")
            library.rtcSetGeometryInstancedScene(geometry, mesh.pointer)
            library.rtcSetGeometryTimeStepCount(geometry, 1)
            library.rtcSetGeometryMask(geometry, packets.EVERYTHING)
            library.rtcAttachGeometryByID(self.pointer, geometry, number)
            library.rtcReleaseGeometry(geometry)  # the scene holds it, and so our handle stays valid
            self._instances[number] = geometry
            self._place(geometry, transform)
        library.rtcCommitScene(self.pointer)
        device.check("the scene")

    def _place(self, geometry: int, transform: npt.NDArray[np.float64] | None) -> None:
        library = self.device.library
        if transform is None:
            library.rtcDisableGeometry(geometry)
        else:
            columns = np.ascontiguousarray(transform[:3].T, np.float32)
            library.rtcSetGeometryTransform(geometry, 0, _FLOAT3X4_COLUMN_MAJOR, columns.ctypes.data)
            library.rtcEnableGeometry(geometry)
        library.rtcCommitGeometry(geometry)

    def move(self, number: int, transform: npt.NDArray[np.float64] | None) -> None:
        """Places an instance anew; None takes it out."""
        if number in self._instances:
            self._place(self._instances[number], transform)
            self.device.library.rtcCommitScene(self.pointer)
            self.device.check("the scene")

    def close(self) -> None:
        """Frees the scene; its meshes go when nobody else holds them."""
        self._release()
        self._instances, self.meshes = {}, ()


def _address(function: object) -> int:
    return ctypes.cast(function, _pointer).value or 0  # type: ignore[arg-type]


def _new_packet() -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    floats = np.zeros(packets.ROWS * 8 + 8, np.float32)
    skip = (-floats.ctypes.data % packets.ALIGNMENT) // 4
    integers = np.full(16, -1, np.int32)
    start = (-integers.ctypes.data % packets.ALIGNMENT) // 4
    return floats[skip : skip + packets.ROWS * 8].reshape(packets.ROWS, 8), integers[start : start + 8]
