"""Kirchhoff's rod in space: equilibrium under its own weight."""

import numpy as np
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation


def hanging(
    natural: np.ndarray, stiffness: np.ndarray, weight: np.ndarray, frame: np.ndarray, stages: int = 10
) -> np.ndarray:
    """Centre line, `1001 × 3`, of a rod of length 1 clamped at the origin with the frame `frame` (columns d1, d2, tangent).

    `natural` is the natural strain (κ1, κ2, τ), `stiffness` (EI1, EI2, GJ), `weight` the force per length. The unknowns
    are position, frame as a quaternion, and strain Ω; the force across a section is the weight below it, so that
    K(Ω − Ω̄)' = −Ω × K(Ω − Ω̄) − e3 × Rᵀ n (Love 1927, §254). The weight is brought up in `stages`.
    """
    turns = np.linalg.norm(natural) / (2 * np.pi)
    s = np.linspace(0, 1, int(60 * (turns + 2)))
    root = Rotation.from_matrix(frame)
    along = root * Rotation.from_rotvec(s[:, None] * natural)
    tangent = along.apply([0.0, 0.0, 1.0])
    step = s[1] - s[0]
    place = np.concatenate([np.zeros((1, 3)), np.cumsum((tangent[1:] + tangent[:-1]) * step / 2, axis=0)])
    y = np.concatenate([place.T, along.as_quat().T, np.tile(natural[:, None], s.size)])
    y[3:7] = continuous(y[3:7])
    start = y[3:7, 0].copy()

    def boundary(a, b):
        return np.concatenate([a[:3], a[3:7] - start, b[7:] - natural])

    for share in np.linspace(0, 1, stages + 1):

        def slope(s, y, share=share):
            qx, qy, qz, qw = y[3:7]
            w1, w2, w3 = y[7:]
            tangent = np.array(
                [2 * (qx * qz + qw * qy), 2 * (qy * qz - qw * qx), 1 - 2 * (qx * qx + qy * qy)]
            )
            turning = 0.5 * np.array(
                [
                    qw * w1 + qy * w3 - qz * w2,
                    qw * w2 + qz * w1 - qx * w3,
                    qw * w3 + qx * w2 - qy * w1,
                    -qx * w1 - qy * w2 - qz * w3,
                ]
            )
            force = share * weight[:, None] * (1 - s)
            # Components along d1 and d2.
            u = np.array([qx, qy, qz])
            back = force - 2 * qw * np.cross(u, force, axis=0)
            back = back + 2 * np.cross(u, np.cross(u, force, axis=0), axis=0)
            moment = stiffness[:, None] * (y[7:] - natural[:, None])
            change = -np.cross(y[7:], moment, axis=0) - np.array([-back[1], back[0], np.zeros_like(s)])
            return np.concatenate([tangent, turning, change / stiffness[:, None]])

        found = solve_bvp(slope, boundary, s, y, tol=1e-8, max_nodes=200_000)
        if not found.success:
            raise ArithmeticError(found.message)
        y = found.sol(s)
    return found.sol(np.linspace(0, 1, 1001))[:3].T


def continuous(q: np.ndarray) -> np.ndarray:
    """Quaternions in columns, with signs such that neighbours are near."""
    flips = np.where((q[:, 1:] * q[:, :-1]).sum(axis=0) < 0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(flips)])
