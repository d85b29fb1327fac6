"""A weightless column between a clamp and a plate on which its end may turn but not move."""

import numpy as np
from scipy.integrate import solve_bvp

from ..arrays import FloatArray

CRITICAL = 4.493409457909064
"""√(P L²/EI) at which the straight column buckles: tan k = k (Timoshenko and Gere 1961, §2.4)."""


def friction(shortening: FloatArray) -> FloatArray:
    """|Ft/Fn| at the end on the plate for each shortening, the approach of the ends in L, increasing.

    The column is clamped upright at the origin of x and z, with z towards the plate: θ'' = −P sin θ + H cos θ
    for the force P along z and H across, in EI/L². The end is straight below the clamp and bears no moment.

    Raises:
        ArithmeticError: The solver does not converge.
    """
    s = np.linspace(0.0, 1.0, 400)
    # Start from the first buckling mode, with an amplitude near that of the first shortening.
    k = CRITICAL
    angle = 2.0 * np.sqrt(shortening[0]) * (k * np.sin(k * s) + np.cos(k * s) - 1.0) / k
    step = s[1] - s[0]
    y = np.array(
        [angle, np.gradient(angle, s), np.cumsum(np.sin(angle)) * step, np.cumsum(np.cos(angle)) * step]
    )
    forces = np.array([k * k, 0.0])
    found = []
    for e in shortening:

        def slope(_: FloatArray, y: FloatArray, p: FloatArray) -> FloatArray:
            return np.array([y[1], -p[0] * np.sin(y[0]) + p[1] * np.cos(y[0]), np.sin(y[0]), np.cos(y[0])])

        def boundary(a: FloatArray, b: FloatArray, _: FloatArray, e: float = e) -> FloatArray:
            return np.array([a[0], a[2], a[3], b[1], b[2], b[3] - (1.0 - e)])

        solved = solve_bvp(slope, boundary, s, y, p=forces, tol=1e-8, max_nodes=100_000)
        if not solved.success:
            raise ArithmeticError(f"shortening {e}: {solved.message}")
        # Back to the first mesh: the one refined for this shape may not suit the next.
        y, forces = solved.sol(s), np.asarray(solved.p)
        found.append(abs(forces[1] / forces[0]))
    return np.array(found)
