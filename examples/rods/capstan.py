"""A strand slides over a drum: the tension grows with the angle, e^(µφ) (Euler 1769, Eytelwein 1808).

A stiff strand stands off the drum at both ends (Stuart 1961). With β = EI/2R² the elastica leaves it at an
angle δ to the pull T, 1 − cos δ = β/T, and presses on it there with T sin δ, so that
(T₁ − β + µ T₁ sin δ₁) e^(µ(φ − δ₁ − δ₂)) = T₂ − β − µ T₂ sin δ₂.

python examples/rods/capstan.py -o capstan.png
"""

import argparse

import numpy as np
from matplotlib import pyplot as plt
from scipy.optimize import brentq

from hairbake.rods import HORIZONTAL, IDENTITY, Pose, Rod, Scene, Strand, simulate

parser = argparse.ArgumentParser()
parser.add_argument("-o", "--output", default="capstan.png")
output = parser.parse_args().output

DRUM, GAP, ENDS, PULL = 0.02, 5e-4, 0.03, 2e-4
"""Radius of the drum, distance kept from it, free lengths of a strand, m, and pull at its tip, N."""
RADIUS = DRUM + GAP
STIFFNESS = PULL * RADIUS**2 / 30
CASES = [(mu, np.radians(degrees)) for mu in (0.2, 0.4) for degrees in (45, 90, 135, 180)]


def ratio(mu: float, phi: float) -> float:
    """Tension at the clamp over that at the tip, of a stiff strand."""
    beta = STIFFNESS / (2 * RADIUS**2 * PULL)

    def angle(tension: float) -> float:
        return float(np.arccos(1 - beta / tension))

    def balance(tension: float) -> float:
        there, here = angle(1), angle(tension)
        inside = (1 - beta + mu * np.sin(there)) * np.exp(mu * (phi - there - here))
        return float(tension - beta - mu * tension * np.sin(here) - inside)

    return float(brentq(balance, 0.5, 2 * np.exp(mu * phi)))


def drawn(phi: float, z: float) -> np.ndarray:
    """A strand that lies on the drum over the angle φ, slightly above it."""
    a, end = np.linspace(0, phi, 90), np.linspace(0, ENDS, 10)[1:, None]
    arc = (RADIUS + 3e-4) * np.stack([np.sin(a), np.cos(a)], axis=1)
    points = np.vstack([arc[0] - end[::-1] * [1, 0], arc, arc[-1] + end * [np.cos(phi), -np.sin(phi)]])
    return np.column_stack([points, np.full(len(points), z)])


def clamp(t: float) -> Pose:
    """The clamp draws the strands over the drum from time 0 on."""
    return np.array([-5e-3 * max(t, 0.0), 0, 0]), IDENTITY


strands, loads = [], []
for i, (mu, phi) in enumerate(CASES):
    points = drawn(phi, 0.05 * i)
    rod = Rod(
        length=np.linalg.norm(np.diff(points, axis=0), axis=1).sum(),
        bending=(STIFFNESS, STIFFNESS),
        torsion=STIFFNESS,
        damping=0.01,
        drag=1.0,
        natural=(0, 0, 0),
        friction=mu,
    )
    strands.append(Strand(rod, points, HORIZONTAL))
    pull = [PULL * np.cos(phi), -PULL * np.sin(phi), 0]
    loads.append({"name": f"pull {i}", "ids": [i], "force_n": pull})
drum = {"type": "capsule", "ends": [[0, 0, -1], [0, 0, 1]], "radius": DRUM}
motion = simulate(
    Scene(
        strands,
        frames=4,
        preroll=0.3,
        arc=np.linspace(0, 1, 33).tolist(),
        gravity=(0, 0, 0),
        motion=clamp,
        colliders=[{"name": "drum", "shape": drum, "thickness_m": GAP}],
        loads=loads,
        settings={"reactions": True, "contact": "bodies", "scheme": "backward-euler"},
    )
)
assert motion.clamp_forces is not None
found = -motion.clamp_forces[-1, :, 0] / PULL
errors = []
for (mu, phi), tension in zip(CASES, found, strict=True):
    errors.append(abs(tension / ratio(mu, phi) - 1))
    print(f"µ = {mu}, {np.degrees(phi):3.0f}°: {tension:.4f}, of a stiff strand {ratio(mu, phi):.4f}", end="")
    print(f", e^µφ {np.exp(mu * phi):.4f}")
print(f"largest relative error {max(errors):.1e}")

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for points in motion.points[4:]:
    left.plot(*(100 * points[-1, :, :2].T), linewidth=2)
left.add_patch(plt.Circle((0, 0), 100 * DRUM, color="lightgrey"))
left.set(xlabel="cm", ylabel="cm", aspect="equal")
angles = np.radians(np.linspace(25, 200, 50))
for colour, mu in enumerate((0.2, 0.4)):
    of_mu = [i for i, case in enumerate(CASES) if case[0] == mu]
    right.semilogy(
        np.degrees(angles),
        np.exp(mu * angles),
        ":",
        color=f"C{colour}",
        label=rf"$e^{{\mu\varphi}}$, µ = {mu}",
    )
    stiff = [ratio(mu, angle) for angle in angles]
    right.semilogy(np.degrees(angles), stiff, color=f"C{colour}", linewidth=0.8, label="stiff strand")
    right.semilogy(
        [np.degrees(CASES[i][1]) for i in of_mu], found[of_mu], "o", color=f"C{colour}", label="hairbake"
    )
ticks = [1, 1.5, 2, 3, 4]
right.set_yticks(ticks, labels=[f"{tick:g}" for tick in ticks])
right.minorticks_off()
right.set(xlabel="angle φ, degrees", ylabel="tension at the clamp / pull at the tip", ylim=(1, 4))
right.legend(fontsize=8)
figure.savefig(output, dpi=100)
