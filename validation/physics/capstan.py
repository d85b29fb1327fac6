"""The capstan: tension in a strand drawn over a cylinder by its clamp while its other end hangs."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import GRAVITY, HORIZONTAL, IDENTITY, Pose, Rod, Scene, Strand, straight

from .arrays import FloatArray
from .friction import ramp
from .program import Hairbake
from .study import SCHEMES, Plot, Row, Study, absolute
from .tension import Tensions, tensions

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CYLINDER = 0.05
"""Radius of the cylinder, m."""
THICKNESS = 5e-4
"""Distance kept from it, m."""
RADIUS = CYLINDER + THICKNESS
"""Radius of the circle on which a strand lies, m."""
SPAN, HANGS = 0.2, 0.25
"""Lengths drawn before the top of the cylinder and below its side, m."""
LENGTH = SPAN + 0.5 * np.pi * RADIUS + HANGS
ABOVE = 4 * THICKNESS
"""Height above the cylinder at which strands are drawn, m, so that all of the thickness is kept."""
FPS, SUBSTEPS = 24.0, 8
SPEED = 7.2e-3
"""Speed of the clamp, away from the cylinder, m/s; drag is then about 0.1 % of the weight."""
STILL = 2.5
"""Time before time 0 in which weight is applied and the strand laid down, s."""

CASES = (
    (0.3, 3.0),
    (0.3, 10.0),
    (0.3, 30.0),
    (0.3, 100.0),
    (1.0, 3.0),
    (1.0, 10.0),
    (1.0, 30.0),
    (1.0, 100.0),
)
"""µ, and the hanging weight in EI/R²."""


def strand(mu: float, taut: float, z: float) -> Strand:
    """A strand drawn straight above the cylinder."""
    rod = Rod(length=LENGTH, friction=mu, drag=0.1)
    stiffness = rod.line_density * GRAVITY * HANGS * RADIUS**2 / taut
    rod = Rod(length=LENGTH, friction=mu, drag=0.1, bending=(stiffness, stiffness), torsion=stiffness)
    return Strand(rod, straight(rod, (1, 0, 0), (-SPAN, RADIUS + ABOVE, z)), HORIZONTAL)


def pulled(t: float) -> Pose:
    """The clamp is lowered onto the cylinder before time 0, then draws the strands over it."""
    return np.array([-SPEED * max(t, 0.0), -ABOVE * ramp(t, -0.8, 0.0), 0.0]), IDENTITY


def scene(cases: Sequence[tuple[float, float]], frames: int, nodes: int) -> Scene:
    """One strand for each case."""
    shape = {"type": "capsule", "ends": [[0, 0, -1], [0, 0, 1]], "radius": CYLINDER}
    return Scene(
        [strand(mu, taut, 0.05 * i) for i, (mu, taut) in enumerate(cases)],
        frames=frames,
        fps=FPS,
        substeps=SUBSTEPS,
        preroll=STILL,
        arc=list(np.linspace(0, 1, nodes)),
        gravity=(0, 0, 0),
        force={"frames": [-60, -20], "values": [[0, 0, 0], [0, -GRAVITY, 0]]},
        motion=pulled,
        colliders=[{"name": "cylinder", "shape": shape, "thickness_m": THICKNESS}],
        settings={"scheme": SCHEMES[-1]},
    )


def case_rows(name: str, mu: float, found: list[Tensions]) -> list[Row]:
    """Ratio of the tensions above and below the cylinder in frames in which the strand slides."""
    measured = np.array([t.span / t.hanging for t in found])
    theory = np.array([t.theory / t.hanging for t in found])
    error = np.abs(measured / theory - 1)
    worst = int(error.argmax())
    ideal = float(np.mean([np.exp(mu * t.angle) for t in found]))
    rms = float(np.sqrt((error**2).mean()))
    mean = float(measured.mean())
    return [
        Row(f"{name}, r.m.s.", float(theory.mean()), mean, rms, 0.02),
        Row(f"{name}, worst frame", theory[worst], measured[worst], float(error[worst]), None),
        Row("the same without weight and stiffness", ideal, mean, abs(mean / ideal - 1), None),
    ]


def study(
    hairbake: Hairbake, cases: Sequence[tuple[float, float]] = CASES, frames: int = 96, nodes: int = 33
) -> Study:
    """Strands drawn over a cylinder."""
    drawn = scene(cases, frames, nodes)
    bake = hairbake.bake(drawn)
    rows: list[Row] = []
    curves = []
    for (mu, taut), one, points in zip(cases, drawn.strands, bake.points, strict=True):
        found = [tensions(x, one.rod, RADIUS) for x in points[1:]]
        # By half of the frames all slack is taken up.
        rows += case_rows(
            f"µ = {mu:g}, T R²/EI = {taut:g}: tension above over below", mu, found[frames // 2 :]
        )
        curves.append((mu, taut, np.array([t.span / t.theory - 1 for t in found])))
    truncated = max(frame["shortened"] for frame in bake.figures[1:])
    rows.append(absolute("truncated motions", float(truncated), 0.0))
    text = f"""<p>Strands of a hair's mass hang over a cylinder of {100 * CYLINDER:g} cm, {100 * HANGS:g}
cm of them freely, and are drawn over it at {1e3 * SPEED:g} mm/s by a clamp that is {100 * SPAN:g} cm away.
The hanging part weighs 3 to 100 times EI/R². Tensions are computed from the points of the cache by statics
alone: below the cylinder from the weight, above it from the sag and the bending of the span. Theory: the
law of Euler and Eytelwein with the strand's own weight, and with the forces by which the cylinder holds a
stiff strand where contact begins and ends. {nodes} nodes, {FPS * SUBSTEPS:g} steps a second.</p>"""
    caption = "Tension above the cylinder while strands are drawn over it."
    return Study("The capstan", text, rows, [tension_plot(caption, bake.times[1:], curves)])


def tension_plot(caption: str, times: FloatArray, curves: list[tuple[float, float, FloatArray]]) -> Plot:
    """Relative error of the tension over time; `curves` holds µ, tautness and error of each case."""

    def draw(axes: "Axes") -> None:
        for mu, taut, error in curves:
            axes.plot(times, 100 * error, label=f"µ = {mu:g}, {taut:g}")
        axes.axhspan(-2, 2, alpha=0.1)
        axes.set(xlabel="s", ylabel="tension above over theory − 1, %", ylim=(-10, 10))
        axes.legend(fontsize=7)

    return Plot(caption, draw)
