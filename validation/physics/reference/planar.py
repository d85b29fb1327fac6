"""A rod in a vertical plane: equilibria under weight and wind, and free motion."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.linalg import eigh

from ..arrays import FloatArray
from .spectral import clamped, gauss, integrals

HORIZONTAL = 0.0
"""Angle of a clamp along x."""
DOWN = -np.pi / 2
"""Angle of a clamp straight down."""


@dataclass(frozen=True)
class Shape:
    """An equilibrium in the x-y plane, y up, with the root at the origin, lengths in L."""

    at: Callable[[FloatArray], FloatArray]
    """Angle, curvature, force x and y, x and y (six rows) at arc lengths in [0, 1]."""

    @property
    def tip(self) -> FloatArray:
        """(x, y) of the tip."""
        return self.at(np.array(1.0))[4:]


def equilibrium(
    gamma: float, clamp: float = HORIZONTAL, natural: float = 0.0, wind: float = 0.0, stages: int = 16
) -> Shape:
    """Equilibrium under weight and wind.

    Moment θ' − κ̄ and force n obey n' = −f, θ'' = t_y n_x − t_x n_y (Antman, Nonlinear Problems of
    Elasticity, ch. IV). The loads are applied in stages to the straight rod, then the natural curvature: of
    several equilibria this finds the one that hangs.

    Args:
        gamma: Weight Γ = ρSgL³/EI.
        clamp: Angle of the clamp, rad.
        natural: Natural curvature κ̄, 1/L.
        wind: Drag of a horizontal wind along x across a rod, EI/L³; along a rod it is half.
        stages: Steps in which the loads are applied.

    Raises:
        ArithmeticError: The solver does not converge.
    """
    s = np.linspace(0, 1, 300) ** 2
    y = np.zeros((6, s.size))
    y[0] = clamp
    y[4:] = np.outer([np.cos(clamp), np.sin(clamp)], s)
    loads = np.geomspace(min(1.0, 1.0 / max(gamma, wind)), 1.0, stages)
    bends = np.linspace(0.0, natural, 2 + int(abs(natural) / 1.5))[1:].tolist() if natural else []
    for share, bend in [(load, 0.0) for load in loads.tolist()] + [(1.0, bend) for bend in bends]:

        def slope(_: FloatArray, y: FloatArray, share: float = share) -> FloatArray:
            t = np.array([np.cos(y[0]), np.sin(y[0])])
            fx = wind * (1 - 0.5 * t[0] ** 2)
            fy = -gamma - 0.5 * wind * t[0] * t[1]
            return np.array([y[1], t[1] * y[2] - t[0] * y[3], -share * fx, -share * fy, t[0], t[1]])

        def boundary(a: FloatArray, b: FloatArray, bend: float = bend) -> FloatArray:
            return np.array([a[0] - clamp, a[4], a[5], b[1] - bend, b[2], b[3]])

        found = solve_bvp(slope, boundary, s, y, tol=1e-8, max_nodes=100_000)
        if not found.success:
            raise ArithmeticError(f"Γ = {gamma}, κ̄ = {bend}: {found.message}")
        # Back to the first mesh: the one refined for this load may not suit the next.
        y = found.sol(s)
    return Shape(found.sol)


@dataclass(frozen=True)
class PlanarRod:
    """An inextensible, naturally straight rod, SI units."""

    length: float
    bending: float
    """EI."""
    line_density: float
    damping: float = 0.0
    """Kelvin-Voigt time."""
    drag: float = 0.0
    """Force per length and speed across the rod; along it, half."""


@dataclass(frozen=True)
class Swing:
    """Motion of a rod in the plane, SI units."""

    times: FloatArray
    tip: FloatArray
    """`times × 2`, m, relative to the position of the clamp at time 0."""


@dataclass(frozen=True)
class _Galerkin:
    """Lagrange's equations of an inextensible rod with θ(s, t) in a polynomial basis, SI units."""

    basis: FloatArray
    """Basis functions at the quadrature points, `modes × points`."""
    stiffness: FloatArray
    """Bending stiffness, `modes × modes`."""
    running: FloatArray
    """Takes values at the quadrature points to their integrals from the root to each point."""
    mass: FloatArray
    """Mass of each quadrature point, kg."""
    lengths: FloatArray
    """Length of each quadrature point, m."""
    rod: PlanarRod
    start: float
    """Angle of the clamp, rad."""
    clamp: Callable[[float], tuple[float, float, float]]
    gravity: float

    def rates(self, t: float, state: FloatArray) -> FloatArray:
        """Time derivative of coefficients and their velocities."""
        modes, length = len(self.basis), self.rod.length
        c, v = state[:modes], state[modes:]
        theta, spin = self.start + c @ self.basis, v @ self.basis
        tx, ty = np.cos(theta), np.sin(theta)
        # ∂x/∂c_i = L ∫ n φ_i, n = (−sin θ, cos θ)
        jx = length * self.running @ (-ty * self.basis).T
        jy = length * self.running @ (tx * self.basis).T
        _, speed, acceleration = self.clamp(t)
        ax = acceleration - length * self.running @ (tx * spin**2)
        ay = -length * self.running @ (ty * spin**2)
        vx, vy = speed + jx @ v, jy @ v
        along = 0.5 * (vx * tx + vy * ty)
        fx = -self.rod.drag * self.lengths * (vx - along * tx) - self.mass * ax
        fy = -self.rod.drag * self.lengths * (vy - along * ty) - self.mass * (ay + self.gravity)
        force = jx.T @ fx + jy.T @ fy - self.stiffness @ (c + self.rod.damping * v)
        inertia = (jx.T * self.mass) @ jx + (jy.T * self.mass) @ jy
        return np.concatenate([v, np.linalg.solve(inertia, force)])


def swing(
    rod: PlanarRod,
    *,
    gravity: float,
    angle: Callable[[FloatArray], FloatArray],
    clamp: Callable[[float], tuple[float, float, float]],
    times: FloatArray,
    modes: int = 9,
    tolerance: float = 1e-8,
) -> Swing:
    """Motion of a rod from rest in the shape of angle `angle(s)`, s in [0, 1], SI units.

    `clamp(t)` is position, velocity and acceleration along x of the root, whose direction is constant. θ(s,
    t) is a sum of `modes` polynomials (spectral Galerkin on Lagrange's equations); time integration is Radau
    IIA of order 5 to `tolerance`.

    Raises:
        ArithmeticError: The solver does not converge.
    """
    s, w = gauss(2 * modes + 12)
    basis, slope, _ = clamped(s, modes, 1)
    start = angle(np.zeros(1))[0]
    running, total = integrals(s)
    # The modes of a rod of unit mass for every angle give coefficients of like size.
    _, own = eigh((slope * w) @ slope.T, (basis * w) @ basis.T)
    basis, slope = own.T @ basis, own.T @ slope
    equations = _Galerkin(
        basis=basis,
        stiffness=rod.bending / rod.length * (slope * w) @ slope.T,
        running=running,
        mass=rod.line_density * rod.length * w,
        lengths=rod.length * w,
        rod=rod,
        start=start,
        clamp=clamp,
        gravity=gravity,
    )
    c0 = np.linalg.lstsq((basis * np.sqrt(w)).T, (angle(s) - start) * np.sqrt(w), rcond=None)[0]
    found = solve_ivp(
        equations.rates,
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
    tip = rod.length * np.stack([np.cos(theta) @ total, np.sin(theta) @ total], axis=1)
    tip[:, 0] += [clamp(t)[0] for t in times]
    return Swing(times, tip)
