"""A ray tracer in numba behind embree's own calls: serves where the embree wheel is missing.

`BvhDevice`, `BvhMesh` and `BvhScene` offer what their embree namesakes offer, and `occluded8` and
`intersect8` are addresses of functions with the signatures of rtcOccluded8 and rtcIntersect8, so kernels
never know which tracer they call. The scene pointer is the address of `header`: counts and addresses
of the arrays below. Packets are traced together, instances on two levels; edges are closed by a
tolerance of 1e-6 in barycentric coordinates (embree's ROBUST mode closes them exactly).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from studio_core.jit import batch_function, carray, kernel, pointer
from studio_core.kernels import bvh_build
from studio_core.kernels.packets import (
    DIRECTION,
    GEOMETRY,
    INSTANCE,
    INSTANCE_PRIMITIVE,
    MASK,
    NORMAL,
    OPAQUE,
    ORIGIN,
    PRIMITIVE,
    ROWS,
    SEE_THROUGH,
    TFAR,
    TNEAR,
    U,
    V,
)

F32 = npt.NDArray[np.float32]
U32 = npt.NDArray[np.uint32]
I64 = npt.NDArray[np.int64]

# header: instance tree's node count, bounds, links, order; instance count, matrices, mesh table
HEADER = 8
# mesh table, a row an instance: node count, bounds, links, triangle count, corners, ids
MESH = 6

EDGE = np.float32(1e-6)
TINY = np.float32(1e-30)
LANES = 8
# rows of the scratch: rays in the frame of the current level
ORG, DIR, INV, LIMIT, NEAR = 0, 3, 6, 9, 10
SCRATCH = 11


@kernel
def _invert(rays: F32) -> None:
    for axis in range(3):
        for lane in range(LANES):
            d = rays[DIR + axis, lane]
            if abs(d) < TINY:
                d = TINY if d >= 0 else -TINY
            rays[INV + axis, lane] = np.float32(1.0) / d


@kernel
def _meets(
    rays: F32, low_x: float, low_y: float, low_z: float, high_x: float, high_y: float, high_z: float
) -> bool:
    """Whether any of the eight rays passes the box before its limit (slab test, padded by 3 ulp)."""
    met = 0
    for lane in range(LANES):
        ix, iy, iz = rays[INV, lane], rays[INV + 1, lane], rays[INV + 2, lane]
        ax, bx = (low_x - rays[ORG, lane]) * ix, (high_x - rays[ORG, lane]) * ix
        ay, by = (low_y - rays[ORG + 1, lane]) * iy, (high_y - rays[ORG + 1, lane]) * iy
        az, bz = (low_z - rays[ORG + 2, lane]) * iz, (high_z - rays[ORG + 2, lane]) * iz
        enter = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), rays[NEAR, lane]))
        leave = min(min(max(ax, bx), max(ay, by)), min(max(az, bz), rays[LIMIT, lane]))
        met += 1 if enter <= leave * np.float32(1.0000004) else 0
    return met > 0


@kernel
def _node_met(rays: F32, bounds: F32, node: int) -> bool:
    return _meets(
        rays,
        bounds[node, 0],
        bounds[node, 1],
        bounds[node, 2],
        bounds[node, 3],
        bounds[node, 4],
        bounds[node, 5],
    )


@kernel
def _right_first(rays: F32, bounds: F32, left: int) -> bool:
    """Whether the second child lies nearer along the rays' mean direction."""
    along = np.float32(0.0)
    for axis in range(3):
        mean = np.float32(0.0)
        for lane in range(LANES):
            mean += rays[DIR + axis, lane]
        centre = (
            bounds[left + 1, axis] + bounds[left + 1, 3 + axis] - bounds[left, axis] - bounds[left, 3 + axis]
        )
        along += mean * centre
    return bool(along < 0)


@kernel
def _triangle(rays: F32, lane: int, corner: F32) -> tuple[float, float, float, np.bool_]:
    """Möller and Trumbore 1997: distance, u, v, hit; the point is (1−u−v)·a + u·b + v·c."""
    e1x, e1y, e1z = corner[3] - corner[0], corner[4] - corner[1], corner[5] - corner[2]
    e2x, e2y, e2z = corner[6] - corner[0], corner[7] - corner[1], corner[8] - corner[2]
    dx, dy, dz = rays[DIR, lane], rays[DIR + 1, lane], rays[DIR + 2, lane]
    px, py, pz = dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x
    det = e1x * px + e1y * py + e1z * pz
    inverse = np.float32(1.0) / det if det != 0 else np.float32(0.0)
    sx, sy, sz = rays[ORG, lane] - corner[0], rays[ORG + 1, lane] - corner[1], rays[ORG + 2, lane] - corner[2]
    u = (sx * px + sy * py + sz * pz) * inverse
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    v = (dx * qx + dy * qy + dz * qz) * inverse
    t = (e2x * qx + e2y * qy + e2z * qz) * inverse
    inside: np.bool_ = (u >= -EDGE) & (v >= -EDGE) & (u + v <= np.float32(1.0) + EDGE) & (det != 0)
    return t, u, v, inside & (t >= rays[NEAR, lane]) & (t <= rays[LIMIT, lane])


@kernel
def _leaf(
    rays: F32, corners: F32, ids: U32, first: int, count: int, packet: F32, instance: int, any_hit: bool
) -> None:
    words = packet.view(np.uint32)
    for i in range(first, first + count):
        mask = OPAQUE if ids[i, 1] == 0 else SEE_THROUGH
        for lane in range(LANES):
            t, u, v, hit = _triangle(rays, lane, corners[i])
            if not hit or not (words[MASK, lane] & mask):
                continue
            if any_hit:
                rays[LIMIT, lane] = -np.inf
                continue
            rays[LIMIT, lane] = t
            packet[U, lane], packet[V, lane] = u, v
            words[PRIMITIVE, lane], words[GEOMETRY, lane] = ids[i, 0], ids[i, 1]
            words[INSTANCE, lane], words[INSTANCE_PRIMITIVE, lane] = instance, 0
            c = corners[i]
            e1x, e1y, e1z = c[3] - c[0], c[4] - c[1], c[5] - c[2]
            e2x, e2y, e2z = c[6] - c[0], c[7] - c[1], c[8] - c[2]
            packet[NORMAL, lane] = e1y * e2z - e1z * e2y
            packet[NORMAL + 1, lane] = e1z * e2x - e1x * e2z
            packet[NORMAL + 2, lane] = e1x * e2y - e1y * e2x


@kernel
def _in_mesh(
    rays: F32, mesh: I64, stack: npt.NDArray[np.int32], packet: F32, instance: int, any_hit: bool
) -> None:
    nodes, triangles = mesh[0], mesh[3]
    bounds = carray(pointer(mesh[1]), (nodes, 6), np.float32)
    links = carray(pointer(mesh[2]), (nodes, 2), np.int32)
    corners = carray(pointer(mesh[4]), (triangles, 9), np.float32)
    ids = carray(pointer(mesh[5]), (triangles, 2), np.uint32)
    stack[0] = 0
    height = 1
    while height > 0:
        height -= 1
        node = stack[height]
        if not _node_met(rays, bounds, node):
            continue
        if links[node, 1] > 0:
            _leaf(rays, corners, ids, links[node, 0], links[node, 1], packet, instance, any_hit)
            continue
        left = links[node, 0]
        near = 1 if _right_first(rays, bounds, left) else 0
        stack[height] = left + 1 - near
        stack[height + 1] = left + near
        height += 2


@kernel
def _trace(valid: npt.NDArray[np.int32], header: I64, packet: F32, any_hit: bool) -> None:
    nodes, instances = header[0], header[4]
    if nodes == 0:
        return
    bounds = carray(pointer(header[1]), (nodes, 6), np.float32)
    links = carray(pointer(header[2]), (nodes, 2), np.int32)
    order = carray(pointer(header[3]), instances, np.int32)
    matrices = carray(pointer(header[5]), (instances, 12), np.float32)
    meshes = carray(pointer(header[6]), (instances, MESH), np.int64)
    world = np.empty((SCRATCH, LANES), np.float32)
    local = np.empty((SCRATCH, LANES), np.float32)
    stacks = np.empty((2, bvh_build.STACK), np.int32)
    for lane in range(LANES):
        used = valid[lane] != 0
        for axis in range(3):
            world[ORG + axis, lane] = packet[ORIGIN + axis, lane] if used else np.float32(0.0)
            world[DIR + axis, lane] = packet[DIRECTION + axis, lane] if used else np.float32(1.0)
        world[NEAR, lane] = packet[TNEAR, lane]
        world[LIMIT, lane] = packet[TFAR, lane] if used else np.float32(-np.inf)
    _invert(world)
    stack = stacks[0]
    stack[0] = 0
    height = 1
    while height > 0:
        height -= 1
        node = stack[height]
        if not _node_met(world, bounds, node):
            continue
        first, count = links[node, 0], links[node, 1]
        if count == 0:
            near = 1 if _right_first(world, bounds, first) else 0
            stack[height] = first + 1 - near
            stack[height + 1] = first + near
            height += 2
            continue
        for i in range(first, first + count):
            instance = order[i]
            m = matrices[instance]
            for lane in range(LANES):
                ox, oy, oz = world[ORG, lane], world[ORG + 1, lane], world[ORG + 2, lane]
                dx, dy, dz = world[DIR, lane], world[DIR + 1, lane], world[DIR + 2, lane]
                for axis in range(3):
                    a, b, c = m[4 * axis], m[4 * axis + 1], m[4 * axis + 2]
                    local[ORG + axis, lane] = a * ox + b * oy + c * oz + m[4 * axis + 3]
                    local[DIR + axis, lane] = a * dx + b * dy + c * dz
                local[NEAR, lane] = world[NEAR, lane]
                local[LIMIT, lane] = world[LIMIT, lane]
            _invert(local)
            _in_mesh(local, meshes[instance], stacks[1], packet, instance, any_hit)
            left = 0
            for lane in range(LANES):
                world[LIMIT, lane] = local[LIMIT, lane]
                left += 1 if local[LIMIT, lane] >= local[NEAR, lane] else 0
            if left == 0:
                height = 0
                break
    for lane in range(LANES):
        if valid[lane] != 0:
            packet[TFAR, lane] = world[LIMIT, lane]


@batch_function("void(CPointer(int32), CPointer(int64), CPointer(float32), intp)")
def _occluded8(valid, scene, packet, arguments):  # type: ignore[no-untyped-def]
    _trace(carray(valid, 8), carray(scene, HEADER), carray(packet, (ROWS, 8)), True)


@batch_function("void(CPointer(int32), CPointer(int64), CPointer(float32), intp)")
def _intersect8(valid, scene, packet, arguments):  # type: ignore[no-untyped-def]
    _trace(carray(valid, 8), carray(scene, HEADER), carray(packet, (ROWS, 8)), False)


class BvhMesh:
    """A mesh and its tree: geometry 0 holds the opaque faces, 1 the others."""

    def __init__(self, positions: F32, faces: U32, opaque: int):
        count = len(faces)
        corners = np.ascontiguousarray(positions[faces].reshape(count, 9), np.float32)
        self.bounds, self.links, order = bvh_build.build(bvh_build.triangle_boxes(corners))
        number = np.arange(count)
        see_through = number >= opaque
        ids = np.stack([np.where(see_through, number - opaque, number), see_through], axis=1)
        self.corners = np.ascontiguousarray(corners[order])
        self.ids = np.ascontiguousarray(ids[order], np.uint32)
        self.low, self.high = self.bounds[0, :3].astype(np.float64), self.bounds[0, 3:].astype(np.float64)

    def row(self) -> list[int]:
        """This mesh' row of the scene's mesh table."""
        return [
            len(self.bounds),
            self.bounds.ctypes.data,
            self.links.ctypes.data,
            len(self.corners),
            self.corners.ctypes.data,
            self.ids.ctypes.data,
        ]

    def world_box(self, transform: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Box (6,) around the placed mesh, padded by the rounding of float32."""
        centre, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        middle = transform[:3, :3] @ centre + transform[:3, 3]
        reach = np.abs(transform[:3, :3]) @ half
        reach += 4 * np.finfo(np.float32).eps * (np.abs(middle).max() + reach.max())
        return np.concatenate([middle - reach, middle + reach])


class BvhScene:
    """Instances of meshes; `pointer` stays the same when they move. Don't move while others trace."""

    def __init__(
        self,
        meshes: Sequence[BvhMesh | None],
        transforms: Sequence[npt.NDArray[np.float64] | None],
    ):
        self.meshes = list(meshes)
        count = len(self.meshes)
        self._boxes = np.zeros((count, 6), np.float32)
        self._present = np.zeros(count, bool)
        self._matrices = np.zeros((count, 12), np.float32)
        self._table = np.array(
            [[0] * MESH if mesh is None else mesh.row() for mesh in self.meshes], np.int64
        ).reshape(count, MESH)
        self.header = np.zeros(HEADER, np.int64)
        self.pointer = int(self.header.ctypes.data)
        for number, transform in enumerate(transforms):
            self._place(number, transform)
        self._commit()

    def _place(self, number: int, transform: npt.NDArray[np.float64] | None) -> None:
        mesh = self.meshes[number]
        self._present[number] = mesh is not None and transform is not None
        if mesh is not None and transform is not None:
            square = np.vstack([transform[:3], [0.0, 0.0, 0.0, 1.0]])
            self._matrices[number] = np.linalg.inv(square)[:3].ravel()
            self._boxes[number] = mesh.world_box(transform)

    def _commit(self) -> None:
        present = np.flatnonzero(self._present)
        self.header[0] = 0
        if len(present) == 0:
            return
        self._bounds, self._links, order = bvh_build.build(self._boxes[present])
        self._order = np.zeros(len(self.meshes), np.int32)
        self._order[: len(order)] = present[order]
        arrays = (self._bounds, self._links, self._order, self._matrices, self._table)
        bounds, links, ordered, matrices, table = (array.ctypes.data for array in arrays)
        self.header[1:7] = bounds, links, ordered, len(self.meshes), matrices, table
        self.header[0] = len(self._bounds)

    def move(self, number: int, transform: npt.NDArray[np.float64] | None) -> None:
        """Places an instance anew; None takes it out."""
        self._place(number, transform)
        self._commit()

    def close(self) -> None:
        """Leaves an empty scene."""
        self.header[0] = 0
        self.meshes = []


class BvhDevice:
    """Makes meshes and scenes."""

    name = "bvh"

    def __init__(self) -> None:
        self.occluded8 = _occluded8.address
        self.intersect8 = _intersect8.address

    def mesh(self, positions: F32, faces: U32, opaque: int) -> BvhMesh:
        """Builds the tree of a mesh whose first `opaque` faces are opaque."""
        return BvhMesh(positions, faces, opaque)

    def scene(
        self, meshes: Sequence[BvhMesh | None], transforms: Sequence[npt.NDArray[np.float64] | None]
    ) -> BvhScene:
        """Places meshes by 3×4 matrices; a None leaves its number unused."""
        return BvhScene(meshes, transforms)

    def alone(self, mesh: BvhMesh) -> BvhScene:
        """A scene of one mesh where it stands."""
        return BvhScene([mesh], [np.eye(4)[:3]])
