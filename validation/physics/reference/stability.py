"""Loss of stability of planar equilibria out of their plane."""

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq

from ..arrays import FloatArray
from .planar import DOWN, HORIZONTAL, Shape, equilibrium
from .spectral import clamped, gauss

MODES = 24
"""Number of polynomials for each rotation."""


def margin(shape: Shape, gamma: float, natural: float, out_of_plane: float, torsion: float) -> float:
    """Lowest eigenvalue of the second variation of the energy of `shape` for rotations out of the plane.

    Positive: stable. Sections turn by φ = φ1 d1 + φ3 d3, with d1 the normal in the plane and d3 the tangent.
    Stiffnesses are in the in-plane EI. With the curvature k, the natural one k̄ and w = Γ(1 − s), expansion
    of R exp(φ) to second order gives ½B1(φ1' + kφ3)² + ½C(φ3' − kφ1)² − ½(k − k̄)(k(φ1² + φ3²) + φ3φ1' −
    φ1φ3') + ½w(cos θ φ1φ3 − sin θ φ1²).
    """
    s, weight = gauss(4 * MODES)
    basis, slope, _ = clamped(s, MODES, 1)
    theta, k = shape.at(s)[:2]
    load = gamma * (1 - s)
    zero = np.zeros_like(basis)
    f1, f3 = np.vstack([basis, zero]), np.vstack([zero, basis])
    d1, d3 = np.vstack([slope, zero]), np.vstack([zero, slope])

    def form(a: FloatArray, b: FloatArray, factor: FloatArray | float) -> FloatArray:
        """The symmetric matrix of ∫ factor a b ds."""
        m: FloatArray = (a * (factor * weight)) @ b.T
        return 0.5 * (m + m.T)

    bend, twist, moment = d1 + k * f3, d3 - k * f1, k - natural
    energy = out_of_plane * form(bend, bend, 1.0) + torsion * form(twist, twist, 1.0)
    energy -= form(f1, f1, moment * k + load * np.sin(theta)) + form(f3, f3, moment * k)
    energy += form(f1, d3, moment) - form(f3, d1, moment) + form(f1, f3, load * np.cos(theta))
    norm = form(f1, f1, 1.0) + form(f3, f3, 1.0)
    return float(eigh(energy, norm, eigvals_only=True, subset_by_index=[0, 0])[0])


def critical_natural_curvature(gamma: float, torsion: float) -> float:
    """Smallest natural curvature, 1/L, at which a hanging rod (EI1 = EI2) loses stability in its plane.

    Γ = ρSgL³/EI is its weight (Miller, Lazarus, Audoly and Reis 2014).
    """

    def at(natural: float) -> float:
        return margin(equilibrium(gamma, DOWN, natural), gamma, natural, 1.0, torsion)

    # The last stretch, of length (EI/ρSg)^⅓, buckles: its weight is small against its stiffness.
    step = 0.25 * gamma ** (1 / 3)
    natural = 4 * step
    while at(natural) > 0:
        natural += step
    return float(brentq(at, natural - step, natural, xtol=1e-4))


def critical_weight(out_of_plane: float, torsion: float) -> float:
    """Smallest weight Γ at which a straight rod held out horizontally falls over sideways.

    Weight and stiffnesses are relative to the in-plane EI. Prandtl's Γ = 12.85 √(out_of_plane torsion) is the
    limit for both tending to 0.
    """

    def at(gamma: float) -> float:
        return margin(equilibrium(gamma, HORIZONTAL), gamma, 0.0, out_of_plane, torsion)

    estimate = 12.85 * np.sqrt(out_of_plane * torsion)
    return float(brentq(at, 0.5 * estimate, 2.0 * estimate, xtol=1e-8 * estimate))
