"""Kirchhoff's rod in space: equilibrium under its own weight."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

from ..arrays import FloatArray

Slope = Callable[[FloatArray, FloatArray], FloatArray]


def hanging(
    natural: FloatArray, stiffness: FloatArray, weight: FloatArray, frame: FloatArray, stages: int = 10
) -> FloatArray:
    """Centreline, `1001 × 3`, of a rod of length 1 clamped at the origin.

    The unknowns are position, frame as a quaternion, and strain Ω. The force n across a section is the weight
    below it, so that K(Ω − Ω̄)' = −Ω × K(Ω − Ω̄) − e3 × Rᵀ n (Love 1927, §254).

    Args:
        natural: Natural strain Ω̄ = (κ1, κ2, τ).
        stiffness: K = (EI1, EI2, GJ).
        weight: Weight per length, a vector.
        frame: Frame of the clamp, a matrix with columns d1, d2, tangent.
        stages: Steps in which the weight is applied.

    Raises:
        ArithmeticError: The solver does not converge.
    """
    turns = np.linalg.norm(natural) / (2 * np.pi)
    s = np.linspace(0, 1, int(60 * (turns + 2)))
    y = unloaded(s, natural, frame)
    start = y[3:7, 0].copy()

    def boundary(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.concatenate([a[:3], a[3:7] - start, b[7:] - natural])

    for share in np.linspace(0, 1, stages + 1):
        slope = equations(natural, stiffness, share * weight[:, None])
        found = solve_bvp(slope, boundary, s, y, tol=1e-8, max_nodes=200_000)
        if not found.success:
            raise ArithmeticError(found.message)
        y = found.sol(s)
    centreline: FloatArray = found.sol(np.linspace(0, 1, 1001))[:3].T
    return centreline


def unloaded(s: FloatArray, natural: FloatArray, frame: FloatArray) -> FloatArray:
    """Position, quaternion (x, y, z, w) and strain of the rod without load at arc lengths `s`, `10 × n`."""
    along = Rotation.from_matrix(frame) * Rotation.from_rotvec(s[:, None] * natural)
    tangent = along.apply([0.0, 0.0, 1.0])
    step = s[1] - s[0]
    place = np.concatenate([np.zeros((1, 3)), np.cumsum((tangent[1:] + tangent[:-1]) * step / 2, axis=0)])
    return np.concatenate([place.T, continuous(along.as_quat().T), np.tile(natural[:, None], s.size)])


def equations(natural: FloatArray, stiffness: FloatArray, weight: FloatArray) -> Slope:
    """The derivative of position, quaternion and strain along the rod, for a weight per length (`3 × 1`)."""

    def slope(s: FloatArray, y: FloatArray) -> FloatArray:
        qx, qy, qz, qw = y[3:7]
        w1, w2, w3 = y[7:]
        tangent = np.array([2 * (qx * qz + qw * qy), 2 * (qy * qz - qw * qx), 1 - 2 * (qx * qx + qy * qy)])
        turning = 0.5 * np.array(
            [
                qw * w1 + qy * w3 - qz * w2,
                qw * w2 + qz * w1 - qx * w3,
                qw * w3 + qx * w2 - qy * w1,
                -qx * w1 - qy * w2 - qz * w3,
            ]
        )
        force = weight * (1 - s)
        # The force in the frame of the section; its components along d1 and d2 are used.
        u = np.array([qx, qy, qz])
        local = force - 2 * qw * np.cross(u, force, axis=0)
        local = local + 2 * np.cross(u, np.cross(u, force, axis=0), axis=0)
        moment = stiffness[:, None] * (y[7:] - natural[:, None])
        change = -np.cross(y[7:], moment, axis=0) - np.array([-local[1], local[0], np.zeros_like(s)])
        return np.concatenate([tangent, turning, change / stiffness[:, None]])

    return slope


def continuous(q: FloatArray) -> FloatArray:
    """Quaternions in columns, with signs such that neighbours are near."""
    flips = np.where((q[:, 1:] * q[:, :-1]).sum(axis=0) < 0, -1.0, 1.0)
    signs: FloatArray = np.concatenate([[1.0], np.cumprod(flips)])
    return q * signs
