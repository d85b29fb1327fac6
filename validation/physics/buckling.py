"""Planar equilibria that lose stability: a ribbon held edge-on, and a curved rod that hangs."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import DOWN, EDGE_ON, GRAVITY, Rod, Scene, Strand, straight

from .arrays import FloatArray
from .program import Hairbake
from .reference import stability
from .study import AT_REST, Plot, Study, relative

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TILT = 1e-6
"""Component of gravity across the plane, relative: it makes the strand choose a side."""
SHARES = np.arange(0.9, 1.1001, 0.005)
"""Loads that are tested, relative to the critical one."""
BUCKLED = 0.01
"""Distance from the plane, in L, from which a strand counts as buckled; the tilt causes 1/100 of that."""


def out_of_plane(hairbake: Hairbake, strands: list[Strand], nodes: int) -> FloatArray:
    """Largest distance of each strand from the plane z = 0 at rest, in L."""
    gravity = (0.0, -GRAVITY, GRAVITY * TILT)
    bake = hairbake.bake(Scene(strands, nodes=nodes, gravity=gravity, **AT_REST))
    return np.array(
        [abs(p[-1, :, 2]).max() / s.rod.length for p, s in zip(bake.points, strands, strict=True)]
    )


def onset(distances: FloatArray) -> float:
    """The load, relative to the critical one, midway between the last stable and the first buckled one.

    NaN if all or none of the strands buckle.
    """
    buckled = distances > BUCKLED
    if buckled[0] or not buckled[-1]:
        return float("nan")
    first = int(np.argmax(buckled))
    return float(SHARES[first] + SHARES[first - 1]) / 2


def ribbon(gamma: float, ratio: float) -> Strand:
    """A ribbon held edge-on, of weight Γ relative to its larger stiffness EI2; EI1 = GJ = `ratio` · EI2."""
    rod = Rod(bending=(7.8e-9 * ratio, 7.8e-9), torsion=7.8e-9 * ratio)
    density = gamma * rod.bending[1] / (GRAVITY * rod.length**3)
    rod = replace(rod, line_density=density)
    return Strand(rod, straight(rod, (1, 0, 0)), EDGE_ON)


def lateral(
    hairbake: Hairbake, ratios: Sequence[float] = (0.1, 0.03, 0.01), nodes: Sequence[int] = (8, 16)
) -> Study:
    """Critical weight of ribbons held edge-on."""
    rows, found = [], []
    for ratio in ratios:
        theory = stability.critical_weight(ratio, ratio)
        for n in nodes:
            distances = out_of_plane(hairbake, [ribbon(theory * share, ratio) for share in SHARES], n)
            name = f"EI1 = GJ = {ratio} EI2: critical Γ, {n} nodes"
            rows.append(relative(name, theory, theory * onset(distances), 0.02))
        found.append((f"EI1/EI2 = {ratio}", distances))

    text = """<p>A straight ribbon (EI1 &lt; EI2) held out horizontally, edge-on, falls over sideways at a
critical weight. Theory: the lowest eigenvalue of the second variation of the energy about the sagged
planar equilibrium (Legendre-Galerkin) passes zero; for thin ribbons the weight tends to Prandtl's 12.85
√(EI1 GJ). hairbake: gravity is tilted out of the plane by 1e-6; weights from 90 to 110 % of the critical
one are tested in steps of half a per cent. The onset is where the strand leaves the plane by more than
1e-2 L.</p>"""
    plot = distance_plot(
        "Beyond the critical weight the ribbon falls over.", "weight / critical weight", found
    )
    return Study("Lateral buckling of a ribbon", text, rows, [plot])


def hanging(gamma: float, natural: float) -> Strand:
    """A rod (GJ = ⅔ EI) drawn straight down, of natural curvature `natural`/L."""
    rod = Rod(torsion=7.8e-9 * 2 / 3).with_weight(gamma)
    rod = replace(rod, natural=(0.0, natural / rod.length, 0.0))
    return Strand(rod, straight(rod, (0, -1, 0)), DOWN)


def bend_twist(
    hairbake: Hairbake, gammas: Sequence[float] = (30, 100, 300, 1000), nodes: Sequence[int] = (8, 16)
) -> Study:
    """Natural curvature at which a hanging curved rod leaves the plane."""
    rows, critical, measured, found = [], [], [], []
    for gamma in gammas:
        theory = stability.critical_natural_curvature(gamma, 2 / 3)
        critical.append(theory)
        for n in nodes:
            distances = out_of_plane(hairbake, [hanging(gamma, theory * share) for share in SHARES], n)
            name = f"Γ = {gamma}: critical κ̄L, {n} nodes"
            rows.append(relative(name, theory, theory * onset(distances), 0.02))
        measured.append(theory * onset(distances))
        found.append((f"Γ = {gamma}", distances))

    def draw_boundary(axes: "Axes") -> None:
        axes.loglog(gammas, critical, "k-", label="stability of the planar equilibrium")
        axes.loglog(gammas, measured, "o", label=f"hairbake, {nodes[-1]} nodes")
        axes.set(xlabel="Γ", ylabel="critical κ̄L")
        axes.legend()

    text = """<p>A rod of natural curvature κ̄ that hangs from a downward clamp is a planar hook or leaves
the plane (Miller, Lazarus, Audoly and Reis, PRL 112, 068103, 2014). Here GJ = ⅔ EI. Theory and measurement
are those of the ribbon, with κ̄ as the load.</p>"""
    plots = [
        Plot("Boundary between planar (below) and spatial shapes (above).", draw_boundary),
        distance_plot(
            "Beyond the boundary the strand leaves the plane.", "natural curvature / critical", found
        ),
    ]
    return Study("Bend-twist: a curved rod hanging", text, rows, plots)


def distance_plot(caption: str, load: str, found: list[tuple[str, FloatArray]]) -> Plot:
    """Distance from the plane against the load, for each labelled series."""

    def draw(axes: "Axes") -> None:
        for label, distances in found:
            axes.semilogy(SHARES, distances, "o-", markersize=3, label=label)
        axes.axvline(1.0, color="grey", linewidth=0.8)
        axes.set(xlabel=load, ylabel="out of the plane / L")
        axes.legend()

    return Plot(caption, draw)
