"""Rays against a scene of placed meshes: who is in the way, and what is hit first.

`RayCaster` validates and shares meshes, places them, and traces batches of rays on `Workers`; kernels
with rays of their own take the integers of `handles()`. Both tracers, embree and our own, work in
float32 around `centre`, the middle of the scene when it was made, so that large coordinates cost no
precision; meshes are likewise kept around their own middle.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.arrays import content_hash
from studio_core.errors import InputError
from studio_core.kernels.caster_mesh import (
    CasterObject,
    Device,
    Scene,
    SharedMesh,
    affine,
    choose_device,
    prepare_mesh,
)
from studio_core.kernels.packets import EVERYTHING, OPAQUE
from studio_core.kernels.ray_batches import closest_chunk, occluded_chunk
from studio_core.parallel import Checkpoints, Workers

__all__ = ["EPSILON_ULPS", "CasterHandles", "CasterObject", "CasterPart", "Hits", "RayCaster"]

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

EPSILON_ULPS = 32
"""Ray origins are lifted off their surface by so many units in the last place of the largest coordinate."""
CHUNK = 4096


@dataclass(frozen=True)
class Hits:
    """First hits of N rays; where nothing is hit t is inf and object and face are −1.

    The hit point is (1−u−v)·a + u·b + v·c for the face's corners a, b, c. `normal` is the face's unit
    normal in the world (counter-clockwise side, also for mirrored objects), `front` says whether the
    ray arrived on that side. t counts in lengths of the ray's direction.
    """

    t: F32
    object: npt.NDArray[np.int32]
    face: npt.NDArray[np.int32]
    u: F32
    v: F32
    normal: F32
    front: Bools


@dataclass(frozen=True)
class CasterHandles:
    """What kernels need to trace packets of their own (see `packets`); valid while the caster is open.

    Origins are float32 relative to `centre`. A hit's instance id is the object's index; its face is
    face_ids[face_start[object, geometry id] + primitive id]; its world normal is normals[object] @ Ng.
    """

    occluded8: int
    intersect8: int
    scene: int
    centre: F64
    epsilon: float
    face_start: npt.NDArray[np.int64]
    face_ids: npt.NDArray[np.int32]
    normals: F32


@dataclass(frozen=True)
class CasterPart:
    """One object by itself, in its own frame: three times as many rays a second as through an instance.

    `scene` is traced with the caster's addresses (0: it has no face that could be met). A world point x is
    from_world @ (x, 1) in that frame, whose origin is the middle of the object's box with half extents
    `half` (3,), and where lengths are `scale` times those of the world. In the world the object lies within
    the sphere of `centre` and `radius`.
    """

    scene: int
    from_world: F64
    scale: float
    half: F64
    centre: F64
    radius: float


class RayCaster:
    """Placed meshes that rays are traced against.

    `previous` lends the tracer and the meshes of an earlier caster that is still open, so that after an
    edit only new meshes are built. `backend` and `reason` tell which tracer is in use and why, `rays`
    how many rays were traced. Don't move objects or close it while another thread traces. `close()` it,
    or use it as a context manager.
    """

    def __init__(
        self, objects: Sequence[CasterObject], backend: str = "auto", previous: RayCaster | None = None
    ):
        if previous is None:
            chosen: tuple[Device, str] = choose_device(backend)
            self._device, self.reason = chosen
            known: dict[tuple[str, str], SharedMesh] = {}
        else:
            self._device, self.reason, known = previous._device, previous.reason, previous._meshes
        self.backend = self._device.name
        self.rays = 0
        self._lock = threading.Lock()
        self._meshes: dict[tuple[str, str], SharedMesh] = {}
        self._objects: list[SharedMesh] = []
        for item in objects:
            shared_key = (item.key, "" if item.occludes is None else content_hash(np.asarray(item.occludes)))
            shared = self._meshes.get(shared_key) or known.get(shared_key) or prepare_mesh(self._device, item)
            if shared.shape != (len(item.positions), len(item.faces)):
                raise InputError(f"two different meshes are both called {item.key!r}")
            self._meshes[shared_key] = shared
            self._objects.append(shared)
        self._transforms = [affine(item.transform, item.key) for item in objects]
        self._keys = [item.key for item in objects]
        self._parts: dict[int, CasterPart] = {}
        self._lows, self._highs = np.full((len(objects), 3), np.inf), np.full((len(objects), 3), -np.inf)
        for index in range(len(objects)):
            self._bound(index)
        low, high = self._bounds()
        self.centre: F64 = (low + high) / 2
        self._open: Scene | None = self._device.scene(
            [shared.mesh for shared in self._objects], [self._placed(i) for i in range(len(objects))]
        )
        self._collect_faces()
        self._normals = np.zeros((len(objects), 3, 3), np.float32)
        for index in range(len(objects)):
            self._turn(index)
        self._measure()

    def __enter__(self) -> RayCaster:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._objects)

    def close(self) -> None:
        """Frees the scene at once, and its meshes unless another caster uses them."""
        if self._open is not None:
            self._open.close()
        self._open, self._objects, self._meshes = None, [], {}

    @property
    def _scene(self) -> Scene:
        if self._open is None:  # its address leads nowhere
            raise RuntimeError("this ray caster is closed")
        return self._open

    def move(self, index: int, transform: F64) -> None:
        """Places an object anew; `centre` stays, `epsilon` may grow."""
        scene = self._scene
        self._transforms[index] = affine(transform, self._keys[index])
        scene.move(index, self._placed(index))
        self._parts.pop(index, None)
        self._bound(index)
        self._turn(index)
        self._measure()

    def local(self, points: npt.ArrayLike) -> F32:
        """World points (…, 3) as the tracers see them: float32 relative to `centre`."""
        return (np.asarray(points, np.float64) - self.centre).astype(np.float32)

    def count(self, rays: int) -> None:
        """Adds to `rays`; for kernels that trace through `handles`."""
        with self._lock:
            self.rays += rays

    def handles(self) -> CasterHandles:
        """The integers and tables that kernels trace with; ask again after a move."""
        device = self._device
        return CasterHandles(
            device.occluded8,
            device.intersect8,
            self._scene.pointer,
            self.centre,
            self.epsilon,
            self._face_start,
            self._face_ids,
            self._normals,
        )

    def part(self, index: int) -> CasterPart:
        """An object by itself; ask again after a move. Only uniform scales."""
        if index not in self._parts:
            self._parts[index] = self._alone(index)
        return self._parts[index]

    def _alone(self, index: int) -> CasterPart:
        shared, transform = self._objects[index], self._transforms[index]
        linear = transform[:3, :3]
        scale = float(np.cbrt(abs(np.linalg.det(linear))))
        centre = linear @ shared.middle + transform[:3, 3]
        if shared.alone is None or self._placed(index) is None:
            return CasterPart(0, np.eye(4)[:3], 1.0, np.zeros(3), centre, 0.0)
        inverse = np.linalg.inv(linear)
        from_world = np.column_stack([inverse, -inverse @ centre])
        radius = shared.radius * scale
        return CasterPart(shared.alone.pointer, from_world, 1 / scale, shared.half, centre, radius)

    def occluded(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        tfar: npt.ArrayLike,
        workers: Workers,
        job: Checkpoints | None = None,
        mask: int = OPAQUE,
    ) -> Bools:
        """Whether anything opaque lies between 0 and tfar on each of N rays; (N,) bool.

        origins (N, 3) in the world, float64 where coordinates are large; directions (N, 3) of any
        length; tfar a number or (N,), in lengths of the direction. Rays that are not finite are free.
        """
        starts, along, far = self._rays(origins, directions, tfar)
        out = np.zeros(len(starts), bool)
        address, scene = self._device.occluded8, self._scene.pointer

        def body(start: int, stop: int) -> None:
            occluded_chunk(address, scene, starts, along, far, np.uint32(mask), out, start, stop)

        workers.run(len(starts), CHUNK, body, job)
        self.count(len(starts))
        return out

    def closest(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        tnear: float,
        tfar: npt.ArrayLike,
        workers: Workers,
        job: Checkpoints | None = None,
        mask: int = EVERYTHING,
    ) -> Hits:
        """The first face of each of N rays between tnear and tfar, see-through faces included.

        Arguments as in `occluded`; `mask=OPAQUE` passes through faces that don't stop light.
        """
        starts, along, far = self._rays(origins, directions, tfar)
        n = len(starts)
        t, ids, uv = np.empty(n, np.float32), np.empty((n, 2), np.int32), np.empty((n, 2), np.float32)
        normal, front = np.empty((n, 3), np.float32), np.empty(n, bool)
        address, scene, near, bits = (
            self._device.intersect8,
            self._scene.pointer,
            np.float32(tnear),
            np.uint32(mask),
        )
        tables = (self._face_start, self._face_ids, self._normals)

        def body(start: int, stop: int) -> None:
            closest_chunk(
                address,
                scene,
                starts,
                along,
                near,
                far,
                bits,
                *tables,
                t,
                ids,
                uv,
                normal,
                front,
                start,
                stop,
            )

        workers.run(n, CHUNK, body, job)
        self.count(n)
        return Hits(t, ids[:, 0], ids[:, 1], uv[:, 0], uv[:, 1], normal, front)

    def _rays(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, tfar: npt.ArrayLike
    ) -> tuple[F32, F32, F32]:
        with np.errstate(over="ignore", invalid="ignore"):
            starts = np.ascontiguousarray(self.local(origins))
            along = np.ascontiguousarray(directions, np.float32)
            far = np.asarray(tfar, np.float32)
        if starts.ndim != 2 or starts.shape[1] != 3 or along.shape != starts.shape:
            raise ValueError(f"rays need (N, 3) origins and directions, not {starts.shape} and {along.shape}")
        return starts, along, np.ascontiguousarray(np.broadcast_to(far, (len(starts),)))

    def _bound(self, index: int) -> None:
        shared, transform = self._objects[index], self._transforms[index]
        if shared.mesh is not None:
            middle = transform[:3, :3] @ shared.middle + transform[:3, 3]
            reach = np.abs(transform[:3, :3]) @ shared.half
            self._lows[index], self._highs[index] = middle - reach, middle + reach

    def _bounds(self) -> tuple[F64, F64]:
        low, high = self._lows.min(axis=0, initial=np.inf), self._highs.max(axis=0, initial=-np.inf)
        if not np.isfinite(low).all():
            return np.zeros(3), np.zeros(3)
        return low, high

    def _placed(self, index: int) -> F64 | None:
        """3×4 matrix from the mesh around its middle to the scene around its centre; None if flat."""
        transform = self._transforms[index]
        linear = transform[:3, :3]
        singular = np.linalg.svd(linear, compute_uv=False)
        if not singular[2] > 1e-6 * singular[0]:
            return None
        shift = linear @ self._objects[index].middle + transform[:3, 3] - self.centre
        return np.column_stack([linear, shift])

    def _collect_faces(self) -> None:
        starts: dict[int, int] = {}
        tables: list[npt.NDArray[np.int32]] = []
        total = 0
        self._face_start = np.zeros((len(self._objects), 2), np.int64)
        for index, shared in enumerate(self._objects):
            if id(shared) not in starts:
                starts[id(shared)] = total
                tables.append(shared.face_ids)
                total += len(shared.face_ids)
            begin = starts[id(shared)]
            self._face_start[index] = begin, begin + shared.opaque
        self._face_ids = np.concatenate([*tables, np.zeros(1, np.int32)])

    def _measure(self) -> None:
        low, high = self._bounds()
        largest = max(float(np.abs(low - self.centre).max()), float(np.abs(high - self.centre).max()), 1e-6)
        self.epsilon = EPSILON_ULPS * float(np.spacing(np.float32(largest)))

    def _turn(self, index: int) -> None:
        self._normals[index] = 0
        if self._placed(index) is not None:
            inverse = np.linalg.inv(self._transforms[index][:3, :3]).T
            self._normals[index] = inverse / np.abs(inverse).max()
