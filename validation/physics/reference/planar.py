"""A rod in a vertical plane: equilibria under weight and wind, and free motion."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.linalg import eigh

from .spectral import clamped, gauss, integrals

HORIZONTAL = 0.0
"""Angle of the clamp: along x."""
DOWN = -np.pi / 2
"""Angle of the clamp: straight down."""


@dataclass(frozen=True)
class Shape:
    """An equilibrium in the x-y plane, y up, the root at the origin, lengths in L."""

    at: Callable[[np.ndarray], np.ndarray]
    """Angle, curvature, force x and y, x and y: six rows, at arc lengths in [0, 1]."""

    @property
    def tip(self) -> np.ndarray:
        """(x, y) of the tip."""
        return self.at(1.0)[4:]


def equilibrium(
    gamma: float, clamp: float = HORIZONTAL, natural: float = 0.0, wind: float = 0.0, stages: int = 16
) -> Shape:
    """Equilibrium under the weight Γ = ρSgL³/EI, of a rod of natural curvature `natural` (in 1/L) clamped at the angle
    `clamp`, in a horizontal wind along x whose drag across a rod is `wind`, in EI/L³, and half of that along it.

    Moment θ' − κ̄ and force n obey n' = −f, θ'' = t_y n_x − t_x n_y (Antman, Nonlinear Problems of Elasticity, ch. IV). First
    the loads are brought up on the straight rod, then the natural curvature: of several equilibria, the one that
    hangs.
    """
    s = np.linspace(0, 1, 300) ** 2
    y = np.zeros((6, s.size))
    y[0] = clamp
    y[4:] = np.outer([np.cos(clamp), np.sin(clamp)], s)
    loads = np.geomspace(min(1.0, 1.0 / max(gamma, wind)), 1.0, stages)
    bends = np.linspace(0.0, natural, 2 + int(abs(natural) / 1.5))[1:] if natural else []
    for share, bend in [(load, 0.0) for load in loads] + [(1.0, bend) for bend in bends]:

        def slope(_, y, share=share):
            t = np.array([np.cos(y[0]), np.sin(y[0])])
            fx = wind * (1 - 0.5 * t[0] ** 2)
            fy = -gamma - 0.5 * wind * t[0] * t[1]
            return np.array([y[1], t[1] * y[2] - t[0] * y[3], -share * fx, -share * fy, t[0], t[1]])

        def boundary(a, b, bend=bend):
            return np.array([a[0] - clamp, a[4], a[5], b[1] - bend, b[2], b[3]])

        found = solve_bvp(slope, boundary, s, y, tol=1e-8, max_nodes=100_000)
        if not found.success:
            raise ArithmeticError(f"Γ = {gamma}, κ̄ = {bend}: {found.message}")
        # On the first mesh again: the one refined for this load need not suit the next.
        y = found.sol(s)
    return Shape(found.sol)


@dataclass(frozen=True)
class Swing:
    """Motion of a rod in the plane; SI units."""

    times: np.ndarray
    tip: np.ndarray
    """`times × 2`, m, relative to the clamp's position at time 0."""


def swing(
    *,
    length: float,
    bending: float,
    line_density: float,
    gravity: float,
    angle: Callable[[np.ndarray], np.ndarray],
    clamp: Callable[[float], tuple[float, float, float]],
    times: np.ndarray,
    damping: float = 0.0,
    drag: float = 0.0,
    modes: int = 9,
    tolerance: float = 1e-8,
) -> Swing:
    """Motion of an inextensible naturally straight rod from rest in the shape whose angle is `angle(s)`, s in [0, 1]; SI units.

    `clamp(t)` is position, velocity and acceleration along x of the root, whose direction stays. θ(s, t) is a
    polynomial of degree `modes` (spectral Galerkin on Lagrange's equations), time is Radau IIA of order 5 to
    `tolerance`.
    `damping` is the Kelvin-Voigt time, `drag` the force per length and speed across the rod, half of it along.
    """
    s, w = gauss(2 * modes + 12)
    basis, slope, _ = clamped(s, modes, 1)
    start = angle(np.zeros(1))[0]
    running, total = integrals(s)
    # In the modes of a rod of unit mass for every angle, the numbers are of like size.
    _, own = eigh((slope * w) @ slope.T, (basis * w) @ basis.T)
    basis, slope = own.T @ basis, own.T @ slope
    stiffness = bending / length * (slope * w) @ slope.T
    mass = line_density * length * w
    c0 = np.linalg.lstsq((basis * np.sqrt(w)).T, (angle(s) - start) * np.sqrt(w), rcond=None)[0]

    def rates(t, state):
        c, v = state[:modes], state[modes:]
        theta, spin = start + c @ basis, v @ basis
        tx, ty = np.cos(theta), np.sin(theta)
        # ∂x/∂c_i = L ∫ n φ_i, n = (−sin θ, cos θ)
        jx = length * running @ (-ty * basis).T
        jy = length * running @ (tx * basis).T
        _, speed, acceleration = clamp(t)
        ax = acceleration - length * running @ (tx * spin**2)
        ay = -length * running @ (ty * spin**2)
        vx, vy = speed + jx @ v, jy @ v
        along = 0.5 * (vx * tx + vy * ty)
        fx = -drag * length * w * (vx - along * tx) - mass * ax
        fy = -drag * length * w * (vy - along * ty) - mass * (ay + gravity)
        force = jx.T @ fx + jy.T @ fy - stiffness @ (c + damping * v)
        inertia = (jx.T * mass) @ jx + (jy.T * mass) @ jy
        return np.concatenate([v, np.linalg.solve(inertia, force)])

    found = solve_ivp(
        rates,
        (0.0, times[-1]),
        np.concatenate([c0, np.zeros(modes)]),
        method="Radau",
        t_eval=times,
        rtol=tolerance,
        atol=0.1 * tolerance,
    )
    if not found.success:
        raise ArithmeticError(found.message)
    theta = start + found.y[:modes].T @ basis
    tip = length * np.stack([np.cos(theta) @ total, np.sin(theta) @ total], axis=1)
    tip[:, 0] += [clamp(t)[0] for t in times]
    return Swing(times, tip)
