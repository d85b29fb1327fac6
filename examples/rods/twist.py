"""A line with slack is twisted by its ends: it writhes, throws a loop and winds up on itself.

In a long rod with tension T and moment M a helix dies away to both sides of its middle. With m = M/√(EI T) it
takes up the slack D = 4 √(EI/T) √(1 − m²/4), and the ends are turned by ML/GJ + 4 acos(m/2) (Coyne 1990; van
der Heijden and Thompson 2000). For a given slack the turn has a largest value. Beyond it the rod jumps to a
loop that touches itself.

python examples/rods/twist.py -o twist.png
"""

import argparse

import numpy as np
from matplotlib import pyplot as plt

from hairbake.rods import HORIZONTAL, Pose, Rod, Scene, Strand, simulate

parser = argparse.ArgumentParser()
parser.add_argument("-o", "--output", default="twist.png")
output = parser.parse_args().output

# A nylon line of 2 mm and half a metre, which the air stops; its ends come closer by a quarter.
LENGTH, RADIUS, SLACK, TURNS, SECONDS = 0.5, 1e-3, 0.25, 6.0, 5.2
bending = 2.5e9 * np.pi / 4 * RADIUS**4
torsion = 0.7 * bending
line = Rod(
    length=LENGTH,
    bending=(bending, bending),
    torsion=torsion,
    line_density=1150 * np.pi * RADIUS**2,
    damping=0.01,
    drag=50.0,
    friction=0.0,
    radius=RADIUS,
)
s = np.linspace(0, 1, 41)
almost_straight = np.stack([LENGTH * s, 2e-4 * np.sin(np.pi * s) ** 2, 0 * s], axis=1)


def turned(t: float) -> float:
    """Turns of the far end at a time, s."""
    return TURNS * min(max(t / SECONDS, 0.0), 1.0)


def hand(t: float) -> Pose:
    """The far end comes closer before time 0, then turns."""
    closer = SLACK * LENGTH * min(max(t + 2, 0.0), 1.0)
    half = np.pi * turned(t)
    return np.array([-closer, 0, 0]), np.array([np.cos(half), np.sin(half), 0, 0])


motion = simulate(
    Scene(
        [Strand(line, almost_straight, HORIZONTAL)],
        frames=round(24 * SECONDS),
        substeps=2,
        preroll=3,
        arc=np.linspace(0, 1, 33).tolist(),
        gravity=(0, 0, 0),
        bodies={"hand": hand},
        ties=[{"name": "end", "body": "hand", "ids": [0], "arc_share": 1, "orientation": "drawn"}],
        settings={"reactions": True, "contact": "full", "scheme": "backward-euler"},
    )
)
assert motion.tie_forces is not None and motion.tie_moments is not None
turns = np.array([turned(t) for t in motion.times])
moment, tension = motion.tie_moments[:, 0, 0], motion.tie_forces[:, 0, 0]

# Theory by x = L √(T/EI), up to the largest turn. A rod is long if x is.
x = np.linspace(0.1, 4 / SLACK / np.sqrt(2), 500)
m = 2 * np.sqrt(1 - (SLACK * x / 4) ** 2)
theory = m * x * bending / LENGTH
turns_theory = (m * x * bending / torsion + 4 * np.arccos(m / 2)) / (2 * np.pi)
long = (turns > np.interp(8, x, turns_theory)) & (turns < turns_theory[-1])
error = np.abs(moment[long] / np.interp(turns[long], turns_theory, theory) - 1).max()
contacts = np.array([figures.get("strand_contacts_active", 0) for figures in motion.figures])
first = turns[np.argmax(contacts > 0)]
print(f"the largest turn of theory is {turns_theory[-1]:.2f}; the line touches itself from {first:.2f} on")
print(f"moment, from {turns[long][0]:.1f} to {turns[long][-1]:.1f} turns: largest relative error {error:.1e}")

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 5), width_ratios=(1, 1.3), layout="constrained")
for row, turn in enumerate((0, 2, 4, 4.6, 5.3, 6)):
    shape = 100 * motion.points[0][np.argmin(np.abs(turns - turn))]
    # Seen from where the line stands out furthest.
    across = shape[:, 1:] - shape[0, 1:]
    seen = across @ across[np.argmax(np.linalg.norm(across, axis=1))]
    seen /= np.linalg.norm(across, axis=1).max()
    left.plot(shape[:, 0], seen - 13 * row, linewidth=2.5, solid_capstyle="round")
    left.annotate(f"{turn:g} turns", (39, -13 * row), va="center", fontsize=8)
left.set(xlabel="cm", aspect="equal", xlim=(-1, 51), yticks=[])
right.plot(turns_theory, 1e3 * theory, "k-", linewidth=0.8, label="theory of a long rod")
right.plot(turns, 1e3 * moment, ".", markersize=4, label="hairbake")
right.axvline(turns_theory[-1], color="grey", linestyle=":", label="largest turn of theory")
right.set(xlabel="turns of the end", ylabel="moment of the tie, mN·m")
right.legend(fontsize=8)
figure.savefig(output, dpi=100)
