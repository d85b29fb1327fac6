"""Terminal shapes in a steady wind."""

import numpy as np

from .reference import planar
from .scene import GRAVITY, ISOLATED_DRAG, Hairbake, Rod, Scene, Strand, quaternion, straight
from .study import AT_REST, Plot, Row, Study

DOWN = quaternion(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
"""Clamp straight down."""


def study(hairbake: Hairbake, winds=(0.1, 0.3, 1.0, 3.0), nodes=(8, 16)) -> Study:
    """A hair hanging in a steady horizontal wind."""
    rod = Rod(drag=1.0)
    scale = rod.length**3 / rod.bending[0]
    gamma = rod.line_density * GRAVITY * scale
    rows, shapes = [], []
    for wind in winds:
        exact = planar.equilibrium(gamma, planar.DOWN, wind=ISOLATED_DRAG * wind * scale)
        for n in nodes:
            strand = Strand(rod, straight(rod, (0, -1, 0)), DOWN)
            scene = Scene([strand], wind=(wind, 0.0, 0.0), nodes=n, frames=20, **AT_REST)
            tip = hairbake.tips(scene)[0, :2] / rod.length
            error = float(np.linalg.norm(tip - exact.tip))
            row = Row(
                f"wind {wind:g} m/s: tip, {n} nodes",
                f"({exact.tip[0]:.6f}, {exact.tip[1]:.6f})",
                f"({tip[0]:.6f}, {tip[1]:.6f})",
                error,
                1e-3,
            )
            rows.append(row)
        curve = hairbake.bake(scene).points[0][-1] / rod.length
        shapes.append((wind, exact.at(np.linspace(0, 1, 200))[4:], curve))

    def draw(axes):
        for wind, line, curve in shapes:
            axes.plot(*line, "k-", linewidth=0.8)
            axes.plot(curve[:, 0], curve[:, 1], ".", label=f"{wind:g} m/s")
        axes.set(xlabel="x / L", ylabel="y / L", aspect="equal")
        axes.legend()

    text = f"""<p>One isolated 25 cm hair (Γ = {gamma:.0f}) hanging from its clamp in a steady horizontal wind. Theory: boundary-value problem with
the same drag law, linear in the speed, 2.07e-4 N·s/m² across the hair and half of that along it.</p>"""
    return Study("Terminal shapes in wind", text, rows, [Plot("Lines: theory; dots: hairbake.", draw)])
