"""Terminal shapes in a steady wind."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import DOWN, GRAVITY, ISOLATED_DRAG, Rod, Scene, Strand, straight

from .program import Hairbake
from .reference import planar
from .study import AT_REST, Plot, Row, Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def study(
    hairbake: Hairbake, winds: Sequence[float] = (0.1, 0.3, 1.0, 3.0), nodes: Sequence[int] = (8, 16)
) -> Study:
    """A hair that hangs in a steady horizontal wind."""
    rod = Rod(drag=1.0)
    scale = rod.length**3 / rod.bending[0]
    gamma = rod.line_density * GRAVITY * scale
    strand = Strand(rod, straight(rod, (0, -1, 0)), DOWN)
    rows, shapes = [], []
    for wind in winds:
        exact = planar.equilibrium(gamma, planar.DOWN, wind=ISOLATED_DRAG * wind * scale)
        for n in nodes:
            scene = Scene([strand], wind=(wind, 0.0, 0.0), nodes=n, frames=20, **AT_REST)
            tip = hairbake.tips(scene)[0, :2] / rod.length
            rows.append(
                Row(
                    f"wind {wind:g} m/s: tip, {n} nodes",
                    f"({exact.tip[0]:.6f}, {exact.tip[1]:.6f})",
                    f"({tip[0]:.6f}, {tip[1]:.6f})",
                    float(np.linalg.norm(tip - exact.tip)),
                    1e-3,
                )
            )
        curve = hairbake.bake(scene).points[0][-1] / rod.length
        shapes.append((wind, exact.at(np.linspace(0, 1, 200))[4:], curve))

    def draw(axes: "Axes") -> None:
        for wind, line, curve in shapes:
            axes.plot(*line, "k-", linewidth=0.8)
            axes.plot(curve[:, 0], curve[:, 1], ".", label=f"{wind:g} m/s")
        axes.set(xlabel="x / L", ylabel="y / L", aspect="equal")
        axes.legend()

    text = f"""<p>One isolated 25 cm hair (Γ = {gamma:.0f}) hangs from its clamp in a steady horizontal
wind. Theory: a boundary-value problem with the same drag law, linear in the speed, 2.07e-4 N·s/m² across
the hair and half of that along it.</p>"""
    return Study("Terminal shapes in wind", text, rows, [Plot("Lines: theory; dots: hairbake.", draw)])
