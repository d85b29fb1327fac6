"""A swing without damping keeps its energy (Lagrange 1788); time schemes lose some of it.

Backward Euler is of first order in the step; the default, a backward differentiation formula (Curtiss and
Hirschfelder 1952) of four steps, is of second order.

python examples/rods/energy.py -o energy.png
"""

import argparse

import numpy as np
from matplotlib import pyplot as plt
from scipy.interpolate import CubicSpline

from hairbake.rods import GRAVITY, HORIZONTAL, Motion, Rod, Scene, Strand, simulate, straight

parser = argparse.ArgumentParser()
parser.add_argument("-o", "--output", default="energy.png")
output = parser.parse_args().output

rod = Rod().with_weight(3.0)
strand = Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL)


def energies(motion: Motion) -> np.ndarray:
    """Kinetic, potential and bending energy of each frame, in ρSgL²."""
    x, v = motion.points[0], motion.velocities[0]
    chords = np.linalg.norm(np.diff(x[0], axis=0), axis=1)
    s = np.concatenate([[0], np.cumsum(chords)])
    bending = 0.5 * rod.bending[0] * (CubicSpline(s, x, axis=1)(s, 2) ** 2).sum(axis=2)
    kinetic = 0.5 * rod.line_density * (v**2).sum(axis=2)
    potential = rod.line_density * GRAVITY * x[:, :, 1]
    parts = [CubicSpline(s, part, axis=1).integrate(0, s[-1]) for part in (kinetic, potential, bending)]
    return np.array(parts) / (rod.line_density * GRAVITY * rod.length**2)


figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for scheme, line in (("backward-euler", "--"), ("four-step", "-")):
    for colour, substeps in enumerate((2, 4, 8)):
        scene = Scene([strand], frames=150, fps=100, substeps=substeps, nodes=12, settings={"scheme": scheme})
        motion = simulate(scene)
        parts = energies(motion)
        change = parts.sum(axis=0) - parts[:, 0].sum()
        print(f"{scheme}, {100 * substeps} steps/s: loses {-change[-1]:.1e} ρSgL², gains {change.max():.0e}")
        left.plot(motion.times, change, line, color=f"C{colour}", label=f"{scheme}, {100 * substeps}/s")
left.set(xlabel="s", ylabel="energy − start, in ρSgL²")
left.legend(fontsize=7)
for part, name in zip([*parts, parts.sum(axis=0)], ("kinetic", "potential", "bending", "sum"), strict=True):
    right.plot(motion.times, part, "k-" if name == "sum" else "-", label=name)
right.set(xlabel="s", ylabel="energy, in ρSgL²", title="four-step, 800 steps/s", ylim=(-0.28, 0.38))
right.legend(fontsize=7, ncols=4)
figure.savefig(output, dpi=100)
