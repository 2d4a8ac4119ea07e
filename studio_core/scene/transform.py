"""Rigid motions with uniform scale, as exact values.

Stored as plain floats: equal transforms are equal values, and a saved one comes back bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]  # (w, x, y, z), unit length


@dataclass(frozen=True, slots=True)
class Transform:
    """x ↦ translation + scale · rotation(x). Metres; `scale` > 0; raises ValueError otherwise."""

    translation: Vec3 = (0.0, 0.0, 0.0)
    rotation: Quat = (1.0, 0.0, 0.0, 0.0)
    scale: float = 1.0

    def __post_init__(self) -> None:
        numbers = (*self.translation, *self.rotation, self.scale)
        if not all(math.isfinite(n) for n in numbers):
            raise ValueError("a transform must be finite")
        if self.scale <= 0:
            raise ValueError("a transform's scale must be positive")
        if abs(math.hypot(*self.rotation) - 1) > 1e-6:
            raise ValueError("a transform's rotation must be a unit quaternion")

    def matrix(self) -> npt.NDArray[np.float64]:
        """4×4, column vectors: world = matrix @ local."""
        made = np.eye(4)
        made[:3, :3] = self.scale * rotation_matrix(self.rotation)
        made[:3, 3] = self.translation
        return made

    def __matmul__(self, child: Transform) -> Transform:
        """The transform of a child seen from this one's parent: first `child`, then self."""
        moved = self.scale * (rotation_matrix(self.rotation) @ np.array(child.translation)) + self.translation
        return Transform(vec3(moved), multiply(self.rotation, child.rotation), self.scale * child.scale)

    def inverse(self) -> Transform:
        """The transform that undoes this one."""
        w, x, y, z = self.rotation
        back = (w, -x, -y, -z)
        moved = rotation_matrix(back) @ np.array(self.translation) / -self.scale
        return Transform(vec3(moved), back, 1 / self.scale)


IDENTITY = Transform()


def vec3(values: npt.ArrayLike) -> Vec3:
    """Three Python floats."""
    x, y, z = (float(v) for v in np.asarray(values, dtype=np.float64))
    return (x, y, z)


def normalized(rotation: Quat) -> Quat:
    """The unit quaternion of the same rotation with w ≥ 0."""
    length = math.hypot(*rotation)
    if length == 0:
        raise ValueError("a zero quaternion is no rotation")
    sign = -1.0 if rotation[0] < 0 else 1.0
    w, x, y, z = (sign * c / length for c in rotation)
    return (w, x, y, z)


def multiply(a: Quat, b: Quat) -> Quat:
    """Rotation `b`, then rotation `a`."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return normalized(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        )
    )


def rotation_matrix(rotation: Quat) -> npt.NDArray[np.float64]:
    """3×3 matrix of a unit quaternion."""
    w, x, y, z = rotation
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion(matrix: npt.ArrayLike) -> Quat:
    """The unit quaternion of a 3×3 rotation matrix (Shepperd's method)."""
    m = np.asarray(matrix, dtype=np.float64)
    t = float(np.trace(m))
    candidates = (t, float(m[0, 0]), float(m[1, 1]), float(m[2, 2]))
    k = int(np.argmax(candidates))
    if k == 0:
        q = (1 + t, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1])
    elif k == 1:
        q = (m[2, 1] - m[1, 2], 1 + 2 * m[0, 0] - t, m[0, 1] + m[1, 0], m[0, 2] + m[2, 0])
    elif k == 2:
        q = (m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], 1 + 2 * m[1, 1] - t, m[1, 2] + m[2, 1])
    else:
        q = (m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], 1 + 2 * m[2, 2] - t)
    return normalized((float(q[0]), float(q[1]), float(q[2]), float(q[3])))


def axis_angle(axis: npt.ArrayLike, degrees: float) -> Quat:
    """Rotation about `axis` by `degrees`, right-handed."""
    unit = np.asarray(axis, dtype=np.float64)
    unit = unit / np.linalg.norm(unit)
    half = math.radians(degrees) / 2
    x, y, z = (float(c) for c in math.sin(half) * unit)
    return normalized((math.cos(half), x, y, z))


def looking(eye: npt.ArrayLike, target: npt.ArrayLike, up: npt.ArrayLike = (0, 1, 0)) -> Transform:
    """A camera's or lamp's transform: at `eye`, its local -z towards `target`, +y near `up`.

    Raises ValueError when eye and target coincide.
    """
    start, forward = np.asarray(eye, dtype=np.float64), np.asarray(target, dtype=np.float64)
    back = start - forward
    length = np.linalg.norm(back)
    if length == 0:
        raise ValueError("eye and target coincide")
    back = back / length
    right = np.cross(np.asarray(up, dtype=np.float64), back)
    if np.linalg.norm(right) < 1e-9:
        right = np.cross((0.0, 0.0, -1.0) if abs(back[1]) > 0.5 else (0.0, 1.0, 0.0), back)
    right = right / np.linalg.norm(right)
    return Transform(vec3(start), quaternion(np.stack([right, np.cross(back, right), back], axis=1)))
