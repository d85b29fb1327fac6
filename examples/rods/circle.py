"""A moment at the tip rolls a straight rod up: 2πEI/L closes it to a circle (Euler 1744).

A rod without other loads has the curvature M/EI everywhere, so its tip is at (sin φ, 1 − cos φ) L/φ with
φ = ML/EI. The moment keeps its axis in space.

python examples/rods/circle.py -o circle.png
"""

import argparse

import numpy as np
from matplotlib import pyplot as plt

from hairbake.rods import HORIZONTAL, Rod, Scene, Strand, simulate, straight

parser = argparse.ArgumentParser()
parser.add_argument("-o", "--output", default="circle.png")
output = parser.parse_args().output

rod = Rod(length=0.1)
turns = np.array([0.125, 0.25, 0.5, 0.75, 1.0])
loads = [
    # The moment grows from second −50 to −10.
    {
        "name": f"moment {i}",
        "ids": [i],
        "moment_n_m": {"frames": [-50, -10], "values": [[0, 0, 0], [0, 0, m]]},
    }
    for i, m in enumerate(2 * np.pi * turns * rod.bending[0] / rod.length)
]
strands = [Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL)] * len(turns)
# Backward Euler with steps of a second finds rest.
settings = {"scheme": "backward-euler"}
motion = simulate(
    Scene(strands, fps=1, substeps=1, preroll=60, gravity=(0, 0, 0), loads=loads, settings=settings)
)

plt.figure(figsize=(6, 4), layout="constrained")
s, errors = np.linspace(0, 1, 100), []
for turn, points in zip(turns, motion.points, strict=True):
    phi = 2 * np.pi * turn
    theory = np.array([np.sin(phi * s), 1 - np.cos(phi * s)]) / phi
    shape = points[-1, :, :2].T / rod.length
    errors.append(np.hypot(*(shape[:, -1] - theory[:, -1])))
    x, y = shape[:, -1]
    print(f"{turn:5.3f} turns: tip at ({x:.7f}, {y:.7f}) L, {errors[-1]:.1e} L from theory")
    plt.plot(*theory, "k-", linewidth=0.8)
    plt.plot(*shape[:, ::2], "o", markersize=4, label=f"{turn:g} · 2πEI/L")
print(f"largest error {max(errors):.1e}")

plt.title("lines: theory; dots: hairbake")
plt.gca().set(xlabel="x / L", ylabel="y / L", aspect="equal")
plt.legend()
plt.savefig(output, dpi=100)
