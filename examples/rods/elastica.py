"""A cantilever sags under its weight: the heavy elastica (Euler 1744; Rohde 1953).

θ'' = −Γ (1 − s) cos θ, with the angle θ of the rod below the horizontal, the arc length s in lengths L, and
Γ = ρSgL³/EI. The clamp holds θ(0) = 0, and the tip bears no moment, θ'(1) = 0.

python examples/rods/elastica.py -o elastica.png
"""

import argparse

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import solve_bvp

from hairbake.rods import HORIZONTAL, Rod, Scene, Strand, simulate, straight

parser = argparse.ArgumentParser()
parser.add_argument("-o", "--output", default="elastica.png")
output = parser.parse_args().output

GAMMAS = (1.0, 3.0, 10.0, 30.0, 100.0)
strands = [Strand(Rod().with_weight(gamma), straight(Rod(), (1, 0, 0)), HORIZONTAL) for gamma in GAMMAS]
# Backward Euler with steps of a second finds rest.
motion = simulate(Scene(strands, fps=1, substeps=1, preroll=60, settings={"scheme": "backward-euler"}))


def elastica(gamma: float, s: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """θ, θ', x and y at the arc lengths `s`, in L."""
    found: np.ndarray = solve_bvp(
        lambda s, y: np.array([y[1], -gamma * (1 - s) * np.cos(y[0]), np.cos(y[0]), -np.sin(y[0])]),
        lambda clamp, tip: np.array([clamp[0], tip[1], clamp[2], clamp[3]]),
        s,
        guess,
        tol=1e-8,
    ).sol(s)
    return found


plt.figure(figsize=(5.5, 5), layout="constrained")
s, theory, errors = np.linspace(0, 1, 101), np.zeros((4, 101)), []
for gamma, points in zip(GAMMAS, motion.points, strict=True):
    # The solution for one weight is the guess for the next.
    theory = elastica(gamma, s, theory)
    rod = points[-1] / Rod().length
    errors.append(np.hypot(*(rod[-1, :2] - theory[2:, -1])))
    print(f"Γ = {gamma:3g}: tip at ({rod[-1, 0]:.5f}, {rod[-1, 1]:.5f}) L, {errors[-1]:.1e} L from theory")
    plt.plot(*theory[2:], "k-", linewidth=0.8)
    plt.plot(*rod[::4, :2].T, "o", markersize=4, label=f"Γ = {gamma:g}")
print(f"largest error {max(errors):.1e}")

plt.title("lines: elastica; dots: hairbake")
plt.gca().set(xlabel="x / L", ylabel="y / L", aspect="equal")
plt.legend()
plt.savefig(output, dpi=100)
