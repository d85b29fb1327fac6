"""A rod clamped at one end sags under its weight: hairbake against the elastica.

python examples/elastica.py
"""

import numpy as np
from numpy.typing import NDArray

from hairbake.rods import HORIZONTAL, Rod, Scene, Strand, simulate, straight

Vector = NDArray[np.float64]

GAMMAS = (1.0, 10.0, 100.0)
"""Weight over bending stiffness, Γ = ρSgL³/EI."""


def slope(gamma: float, s: float, state: Vector) -> Vector:
    """Derivative of (θ, θ', x, y): θ'' = Γ (1 − s) cos θ."""
    theta, curvature = state[:2]
    return np.array([curvature, gamma * (1 - s) * np.cos(theta), np.cos(theta), np.sin(theta)])


def shoot(gamma: float, curvature: float, steps: int = 400) -> Vector:
    """State at s = 1 for a curvature θ'(0) at the clamp, by the Runge-Kutta method."""
    state, h = np.array([0.0, curvature, 0.0, 0.0]), 1 / steps
    for i in range(steps):
        a = slope(gamma, i * h, state)
        b = slope(gamma, (i + 0.5) * h, state + h / 2 * a)
        c = slope(gamma, (i + 0.5) * h, state + h / 2 * b)
        d = slope(gamma, (i + 1) * h, state + h * c)
        state = state + h / 6 * (a + 2 * b + 2 * c + d)
    return state


def elastica_tip(gamma: float) -> Vector:
    """Tip (x, y), in lengths of the rod, of the elastica whose end carries no moment: θ'(1) = 0."""
    # The weight turns the rod down: θ'' is positive against a negative θ'(0).
    low, high = -gamma, 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if shoot(gamma, middle)[1] > 0:
            high = middle
        else:
            low = middle
    return shoot(gamma, middle)[2:]


def main() -> None:
    """Prints the tips of three rods beside those of theory."""
    rods = [Rod().with_weight(gamma) for gamma in GAMMAS]
    strands = [Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL) for rod in rods]
    # Backward Euler with steps of a second finds rest.
    at_rest = Scene(strands, fps=1.0, substeps=1, preroll=60.0, settings={"scheme": "backward-euler"})
    for gamma, rod, points in zip(GAMMAS, rods, simulate(at_rest).points, strict=True):
        tip, theory = points[-1, -1, :2] / rod.length, elastica_tip(gamma)
        error = float(np.hypot(*(tip - theory)))
        print(f"Γ = {gamma:3g}: tip ({tip[0]:.6f}, {tip[1]:.6f}), ", end="")
        print(f"elastica ({theory[0]:.6f}, {theory[1]:.6f}), {error:.1e} L apart")


if __name__ == "__main__":
    main()
