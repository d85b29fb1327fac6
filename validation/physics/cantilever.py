"""A straight rod held out horizontally sags under its weight."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import HORIZONTAL, Rod, Scene, Strand, straight

from .arrays import FloatArray
from .program import Hairbake
from .reference import planar
from .study import AT_REST, Plot, Row, Study, order, relative

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PUBLISHED = {0.1: 0.012500, 1: 0.124562, 10: 1.066802, 100: 5.888105, 1000: 21.335440}
"""H/W, height over reach of the tip, by Γ (Romero et al. 2021)."""

TEXT = """<p>A naturally straight strand clamped horizontally, Γ = ρSgL³/EI from 0.1 to 1000, against the
elastica θ'' = Γ(1 − s) cos θ (boundary-value solver, 1e-8). Error: distance of the tip from theory, in
lengths of the strand. hairbake finds rest in 60 steps of one second; nodes have their default spacing,
(k/(n − 1))^1.5.</p>"""


def sagged_tips(hairbake: Hairbake, gammas: Sequence[float], nodes: int) -> FloatArray:
    """(x, y) of the tips at rest, one row for each Γ, in L."""
    rods = [Rod().with_weight(gamma) for gamma in gammas]
    strands = [Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL) for rod in rods]
    tips = hairbake.tips(Scene(strands, nodes=nodes, **AT_REST))
    return tips[:, :2] / Rod().length


def study(
    hairbake: Hairbake,
    gammas: Sequence[float] = (0.1, 1, 3, 10, 30, 100, 300, 1000),
    nodes: Sequence[int] = (4, 6, 8, 12, 16, 24, 32, 64),
) -> Study:
    """Tip, H/W, and order of convergence in the nodes."""
    theory = np.array([planar.equilibrium(gamma).tip for gamma in gammas])
    tips = np.array([sagged_tips(hairbake, gammas, n) for n in nodes])
    errors = dict(zip(gammas, np.linalg.norm(tips - theory, axis=2).T, strict=True))
    standard = tips[nodes.index(8)]
    aspect = -standard[:, 1] / standard[:, 0]
    rows = []
    for gamma, expected, tip, ratio in zip(gammas, theory, standard, aspect, strict=True):
        rows.append(
            Row(
                f"Γ = {gamma}: tip, 8 nodes",
                f"({expected[0]:.6f}, {expected[1]:.6f})",
                f"({tip[0]:.6f}, {tip[1]:.6f})",
                float(np.linalg.norm(tip - expected)),
                1e-4 if gamma <= 100 else None,
            )
        )
        if gamma in PUBLISHED:
            rows.append(relative(f"Γ = {gamma}: H/W, 8 nodes", PUBLISHED[gamma], ratio, None))
    for gamma in (g for g in gammas if 1 <= g <= 100):
        fine = [(n, e) for n, e in zip(nodes, errors[gamma], strict=True) if n >= 8 and e > 1e-11]
        if len(fine) > 2:
            slope = -order([n - 1 for n, _ in fine], [e for _, e in fine])
            name = f"Γ = {gamma}: order in 1/(n − 1), n ≥ 8"
            rows.append(Row(name, "4", slope, max(0.0, 4 - slope), 0.25))
    return Study("Cantilever under its weight", TEXT, rows, plots(nodes, errors, aspect))


def plots(nodes: Sequence[int], errors: dict[float, FloatArray], aspect: FloatArray) -> list[Plot]:
    """Error against nodes for each Γ, and aspect against Γ."""
    gammas = list(errors)

    def draw_errors(axes: "Axes") -> None:
        for gamma, series in errors.items():
            axes.loglog(nodes, series, "o-", label=f"Γ = {gamma}")
        guide = np.array([8.0, 64.0])
        axes.loglog(guide, 3e-4 * (guide / 8) ** -4.0, "k--", label="fourth order")
        axes.axhline(1e-4, color="grey", linewidth=0.8)
        axes.set(xlabel="nodes", ylabel="tip error / L")
        axes.legend(fontsize=7)

    def draw_aspect(axes: "Axes") -> None:
        fine = np.geomspace(min(gammas), max(gammas), 40)
        tips = [planar.equilibrium(g).tip for g in fine]
        axes.loglog(fine, [-t[1] / t[0] for t in tips], "k-", label="elastica")
        axes.loglog(gammas, aspect, "o", label="hairbake, 8 nodes")
        axes.set(xlabel="Γ", ylabel="H/W")
        axes.legend()

    return [
        Plot("Tip error against the number of nodes.", draw_errors),
        Plot("Height over reach of the tip.", draw_aspect),
    ]
