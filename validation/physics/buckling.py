"""Planar equilibria that lose their stability: a ribbon held edge-on, and a curved rod that hangs."""

from dataclasses import replace

import numpy as np

from .reference import stability
from .scene import GRAVITY, Hairbake, Rod, Scene, Strand, quaternion, straight
from .study import AT_REST, Plot, Study, relative

TILT = 1e-6
"""Gravity's share across the plane: what makes the strand choose a side."""
SHARES = np.arange(0.9, 1.1001, 0.005)
"""Loads that are tried, as shares of the critical one."""
BUCKLED = 0.01
"""A strand that is this far out of the plane, in L, has buckled: the tilt alone moves it by a hundredth of that."""
EDGE_ON = quaternion(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]))
"""Clamp along x, its first section axis up: weight bends about d2."""
DOWN = quaternion(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
"""Clamp straight down, its first section axis along x: a natural curvature about d2 bends towards x."""


def aside(hairbake: Hairbake, strands: list[Strand], nodes: int) -> np.ndarray:
    """Largest distance of each strand from the plane z = 0 at rest, in L."""
    gravity = (0.0, -GRAVITY, GRAVITY * TILT)
    bake = hairbake.bake(Scene(strands, nodes=nodes, gravity=gravity, **AT_REST))
    return np.array([abs(p[-1, :, 2]).max() / s.rod.length for p, s in zip(bake.points, strands)])


def onset(out: np.ndarray) -> float:
    """The load, as a share of the critical one, midway between the last that does not buckle and the first that does; NaN
    where all or none do.
    """
    buckled = out > BUCKLED
    if buckled[0] or not buckled[-1]:
        return float("nan")
    first = int(np.argmax(buckled))
    return float(SHARES[first] + SHARES[first - 1]) / 2


def ribbon(gamma: float, ratio: float) -> Strand:
    """A ribbon of weight Γ by its larger stiffness, EI2, held edge-on; the other ones are `ratio` times that."""
    rod = Rod(bending=(7.8e-9 * ratio, 7.8e-9), torsion=7.8e-9 * ratio)
    density = gamma * rod.bending[1] / (GRAVITY * rod.length**3)
    rod = replace(rod, line_density=density)
    return Strand(rod, straight(rod, (1, 0, 0)), EDGE_ON)


def lateral(hairbake: Hairbake, ratios=(0.1, 0.03, 0.01), nodes=(8, 16)) -> Study:
    """Critical weight of ribbons held edge-on."""
    rows, found = [], []
    for ratio in ratios:
        theory = stability.critical_weight(ratio, ratio)
        for n in nodes:
            out = aside(hairbake, [ribbon(theory * share, ratio) for share in SHARES], n)
            name = f"EI1 = GJ = {ratio} EI2: critical Γ, {n} nodes"
            rows.append(relative(name, theory, theory * onset(out), 0.02))
        found.append((ratio, out))

    def draw(axes):
        for ratio, out in found:
            axes.semilogy(SHARES, out, "o-", markersize=3, label=f"EI1/EI2 = {ratio}")
        axes.axvline(1.0, color="grey", linewidth=0.8)
        axes.set(xlabel="weight / critical weight", ylabel="out of the plane / L")
        axes.legend()

    text = """<p>A straight ribbon (EI1 &lt; EI2) held out horizontally, edge-on, falls over sideways at a critical weight. Theory: the lowest
eigenvalue of the second variation of the energy about the sagged planar equilibrium (Legendre-Galerkin) passes zero; it tends to
Prandtl's 12.85 √(EI1 GJ) for thin ribbons. hairbake: gravity is tilted out of the plane by 1e-6; weights from 90 to 110 % of
the critical one are tried in steps of half a per cent; the onset is where the strand leaves the plane by more than 1e-2 L.</p>"""
    caption = "Beyond the critical weight the ribbon falls over."
    return Study("Lateral buckling of a ribbon", text, rows, [Plot(caption, draw)])


def hanging(gamma: float, natural: float) -> Strand:
    """A rod (GJ = ⅔ EI) drawn straight down, of natural curvature `natural`/L."""
    rod = Rod(torsion=7.8e-9 * 2 / 3).weighing(gamma)
    rod = replace(rod, natural=(0.0, natural / rod.length, 0.0))
    return Strand(rod, straight(rod, (0, -1, 0)), DOWN)


def bend_twist(hairbake: Hairbake, gammas=(30, 100, 300, 1000), nodes=(8, 16)) -> Study:
    """Natural curvature at which a hanging curved rod leaves the plane."""
    rows, critical, measured, shapes = [], [], [], []
    for gamma in gammas:
        theory = stability.critical_natural_curvature(gamma, 2 / 3)
        critical.append(theory)
        for n in nodes:
            out = aside(hairbake, [hanging(gamma, theory * share) for share in SHARES], n)
            rows.append(relative(f"Γ = {gamma}: critical κ̄L, {n} nodes", theory, theory * onset(out), 0.02))
        measured.append(theory * onset(out))
        shapes.append((gamma, out))

    def draw_boundary(axes):
        axes.loglog(gammas, critical, "k-", label="stability of the planar equilibrium")
        axes.loglog(gammas, measured, "o", label=f"hairbake, {nodes[-1]} nodes")
        axes.set(xlabel="Γ", ylabel="critical κ̄L")
        axes.legend()

    def draw_beyond(axes):
        for gamma, out in shapes:
            axes.semilogy(SHARES, out, "o-", markersize=3, label=f"Γ = {gamma}")
        axes.axvline(1.0, color="grey", linewidth=0.8)
        axes.set(xlabel="natural curvature / critical", ylabel="out of the plane / L")
        axes.legend()

    text = """<p>A rod of natural curvature κ̄ hanging from a clamp that points down is a planar hook or leaves the plane (Miller, Lazarus,
Audoly &amp; Reis, PRL 112, 068103, 2014). Here GJ = ⅔ EI. Theory and measurement as for the ribbon, with κ̄ for the load.</p>"""
    plots = [
        Plot("Boundary between planar (below) and spatial shapes (above).", draw_boundary),
        Plot("Beyond the boundary the strand leaves the plane.", draw_beyond),
    ]
    return Study("Bend-twist: a curved rod hanging", text, rows, plots)
