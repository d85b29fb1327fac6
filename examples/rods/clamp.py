"""What holds a swinging hair: the force and the moment of its clamp against the equations of motion.

The force of the clamp and the weight change the momentum ∫ ρS v ds (Newton 1687). The moment of the clamp and
that of the weight about the root change the angular momentum ∫ ρS x × v ds (Euler 1775).

python examples/rods/clamp.py -o clamp.png
"""

import argparse

import numpy as np
from matplotlib import pyplot as plt
from scipy.interpolate import CubicSpline

from hairbake.rods import GRAVITY, HORIZONTAL, Rod, Scene, Strand, simulate, straight

parser = argparse.ArgumentParser()
parser.add_argument("-o", "--output", default="clamp.png")
output = parser.parse_args().output

rod = Rod(damping=2e-3).with_weight(20.0)
weight = rod.line_density * GRAVITY * rod.length
strand = Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL)

rest = simulate(
    Scene(
        [strand],
        fps=1,
        substeps=1,
        preroll=60,
        settings={"scheme": "backward-euler", "reactions": True},
    )
)
assert rest.clamp_forces is not None
at_rest = np.linalg.norm(rest.clamp_forces[-1, 0] - [0, weight, 0]) / weight
print(f"at rest: the force misses the weight by {at_rest:.1e} of it")

swing = simulate(Scene([strand], frames=300, fps=200, substeps=8, nodes=16, settings={"reactions": True}))
assert swing.clamp_forces is not None and swing.clamp_moments is not None
t, x, v = swing.times, swing.points[0], swing.velocities[0]
chords = np.linalg.norm(np.diff(x[0], axis=0), axis=1)
s = np.concatenate([[0], np.cumsum(chords)])


def total(density: np.ndarray) -> np.ndarray:
    """Integral over the mass of the rod in each frame."""
    integral: np.ndarray = rod.line_density * CubicSpline(s, density, axis=1).integrate(0, s[-1])
    return integral


def rate(quantity: np.ndarray) -> np.ndarray:
    """Derivative by time."""
    derivative: np.ndarray = CubicSpline(t, quantity)(t, 1)
    return derivative


gravity = np.array([0, -GRAVITY, 0])
force = rate(total(v)) + [0, weight, 0]
moment = rate(total(np.cross(x, v))) - np.cross(total(x), gravity)
# A spline is not to be trusted at its ends.
inner = slice(5, -5)
found = (swing.clamp_forces[:, 0] / weight, swing.clamp_moments[:, 0] / (weight * rod.length))
theory = (force / weight, moment / (weight * rod.length))
errors = [np.sqrt(((a - b)[inner] ** 2).sum(axis=1).mean()) for a, b in zip(found, theory, strict=True)]
print(f"swinging, r.m.s.: force {errors[0]:.1e} of the weight, moment {errors[1]:.1e} of weight times length")

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for axis, name in enumerate("xy"):
    left.plot(t, found[0][:, axis], color=f"C{axis}", linewidth=1, label=f"force along {name}")
    left.plot(t[::4], theory[0][::4, axis], ".", color=f"C{axis}", markersize=4)
left.plot(t, found[1][:, 2], color="C2", linewidth=1, label="moment about z")
left.plot(t[::4], theory[1][::4, 2], ".", color="C2", markersize=4)
left.set(
    xlabel="s",
    ylabel="force / weight, moment / (weight · L)",
    ylim=(-1.2, 4),
    title="lines: clamp; dots: motion",
)
left.legend(fontsize=8)
for frame in range(0, 100, 6):
    right.plot(*(x[frame, :, :2].T / rod.length), color=plt.colormaps["viridis"](frame / 100))
right.set(xlabel="x / L", ylabel="y / L", aspect="equal", title="the first half second")
figure.savefig(output, dpi=100)
