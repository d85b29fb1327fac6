"""Energy of a free swing of large amplitude, and its drift."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from hairbake.rods import GRAVITY, HORIZONTAL, Rod, Scene, Strand, straight

from .arrays import FloatArray
from .program import Hairbake
from .study import SCHEMES, Plot, Study, absolute

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def total_energy(
    points: FloatArray, velocities: FloatArray, rod: Rod, gravity: float = GRAVITY
) -> FloatArray:
    """Kinetic, potential and bending energy of every frame, J, by splines through the points of the cache."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[0], axis=0), axis=1))])
    s *= rod.length / s[-1]

    def integral(values: FloatArray) -> float:
        return float(CubicSpline(s, values).integrate(0.0, rod.length))

    kinetic = [0.5 * rod.line_density * integral((v**2).sum(axis=1)) for v in velocities]
    potential = [rod.line_density * gravity * integral(x[:, 1]) for x in points]
    fine = np.linspace(0.0, rod.length, 400)
    bending = [
        0.5 * rod.bending[0] * np.trapezoid((CubicSpline(s, x)(fine, 2) ** 2).sum(axis=1), fine)
        for x in points
    ]
    total: FloatArray = np.array(kinetic) + np.array(potential) + np.array(bending)
    return total


def study(hairbake: Hairbake, substeps: Sequence[int] = (4, 16, 64)) -> Study:
    """Energy of a strand released from horizontal."""
    rod = Rod().with_weight(3.0)
    scale = rod.line_density * GRAVITY * rod.length**2
    rows, series = [], []
    for scheme in SCHEMES:
        for n in substeps:
            scene = Scene(
                [Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL)],
                frames=200,
                fps=100.0,
                substeps=n,
                nodes=16,
                settings={"scheme": scheme},
            )
            bake = hairbake.bake(scene)
            total = total_energy(bake.points[0], bake.velocities[0], rod)
            drift = (total - total[0]) / scale
            series.append((scheme, n, bake.times, drift))
            name = f"{scheme}, {100 * n} steps/s"
            finest = n == substeps[-1] and scheme != SCHEMES[0]
            rows.append(
                absolute(f"{name}: energy after 2 s, in ρSgL²", float(drift[-1]), 1e-3 if finest else None)
            )
            rows.append(absolute(f"{name}: largest energy gain", float(max(drift.max(), 0.0)), 2e-3))

    def draw(axes: "Axes") -> None:
        for scheme, n, times, drift in series:
            axes.plot(times, drift, "--" if scheme == SCHEMES[0] else "-", label=f"{scheme}, {100 * n}/s")
        axes.set(xlabel="s", ylabel="energy − start, in ρSgL²")
        axes.legend(fontsize=7)

    text = """<p>A strand (Γ = 3, no damping, no air) released from horizontal swings through large angles;
16 nodes. Kinetic energy is computed from the velocities of the cache, potential and bending energy from
its points, by splines, with an error of a few 1e-4.</p>"""
    caption = "Energy of a free swing, by scheme and step."
    return Study("Energy and its drift", text, rows, [Plot(caption, draw)])
