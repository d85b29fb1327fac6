"""Large motion: a hair whipped by its clamp, against an independent integrator."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import DOWN, GRAVITY, IDENTITY, ISOLATED_DRAG, Pose, Rod, Scene, Strand, straight

from .program import Hairbake
from .reference import planar
from .study import SCHEMES, Plot, Row, Study, absolute, order

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FPS = 25.0
FRAMES = 25


def shake(t: float) -> tuple[float, float, float]:
    """Position, velocity and acceleration along x of a clamp shaken by ±5 cm at 2.5 Hz, SI units.

    It starts from rest; the amplitude rises within 0.2 s.
    """
    if t <= 0:
        return 0.0, 0.0, 0.0
    w, rise = 2 * np.pi * 2.5, 0.2
    u = min(t / rise, 1.0)
    r = np.array([u**3 * (10 - 15 * u + 6 * u * u), 30 * (u * (1 - u)) ** 2, 60 * u * (1 - u) * (1 - 2 * u)])
    r /= [1.0, rise, rise**2]
    s, c = np.sin(w * t), w * np.cos(w * t)
    return 0.05 * r[0] * s, 0.05 * (r[1] * s + r[0] * c), 0.05 * (r[2] * s + 2 * r[1] * c - r[0] * w * w * s)


def shaken(t: float) -> Pose:
    """The motion of the clamp by `shake`."""
    return np.array([shake(t)[0], 0.0, 0.0]), IDENTITY


def scene(substeps: int, scheme: str, nodes: int) -> Scene:
    """A hair with its damping and drag that hangs, then is shaken."""
    rod = Rod(damping=0.005, drag=1.0)
    strand = Strand(rod, straight(rod, (0, -1, 0)), DOWN)
    return Scene(
        [strand],
        frames=FRAMES,
        fps=FPS,
        substeps=substeps,
        nodes=nodes,
        motion=shaken,
        settings={"scheme": scheme},
    )


def study(
    hairbake: Hairbake, substeps: Sequence[int] = (1, 2, 4, 8, 16, 32, 64, 128), nodes: int = 16
) -> Study:
    """Error of a whipped hair's tip against the step."""
    rod = Rod()
    exact = planar.swing(
        planar.PlanarRod(rod.length, rod.bending[0], rod.line_density, damping=0.005, drag=ISOLATED_DRAG),
        gravity=GRAVITY,
        angle=lambda s: planar.DOWN + 0 * s,
        clamp=shake,
        times=np.arange(FRAMES + 1) / FPS,
        modes=11,
    ).tip

    def error(n: int, scheme: str, nodes: int) -> float:
        tip = hairbake.bake(scene(n, scheme, nodes)).points[0][: len(exact), -1, :2]
        return float(np.sqrt(((tip - exact) ** 2).sum(axis=1).mean()) / rod.length)

    steps = [1 / (FPS * n) for n in substeps]
    errors = {scheme: [error(n, scheme, nodes) for n in substeps] for scheme in SCHEMES}
    rows = []
    for scheme, expected in zip(SCHEMES, (1, 2, 2), strict=True):
        rows += [
            absolute(f"{scheme}, {n} steps a frame: tip, r.m.s.", e, None)
            for n, e in zip(substeps, errors[scheme], strict=True)
        ]
        fit = [i for i, n in enumerate(substeps) if 4 <= n <= 16]
        slope = order([steps[i] for i in fit], [errors[scheme][i] for i in fit])
        name = f"{scheme}: order in the step, 4 to 16 steps a frame"
        rows.append(Row(name, str(expected), slope, max(0.0, expected - slope), 0.2))
    finest = f"{SCHEMES[-1]}, {substeps[-1]} steps a frame"
    rows.append(absolute(f"{finest}, {nodes} nodes: tip, r.m.s.", errors[SCHEMES[-1]][-1], 1e-4))
    rows.append(absolute(f"{finest}, 8 nodes: tip, r.m.s.", error(substeps[-1], SCHEMES[-1], 8), 1e-3))

    def draw(axes: "Axes") -> None:
        for scheme, series in errors.items():
            axes.loglog(steps, series, "o-", label=scheme)
        guide = np.array([steps[0], steps[-1]])
        axes.loglog(guide, 2.0 * guide, "k:", label="first order")
        axes.loglog(guide, 8.0 * guide**2, "k--", label="second order")
        axes.set(xlabel="step, s", ylabel="tip error, r.m.s. over 1 s / L")
        axes.legend()

    text = f"""<p>A 25 cm hair with the damping (5 ms) and the air drag of an isolated hair hangs at rest;
then its clamp is shaken by ±5 cm at 2.5 Hz for a second, 25 frames; {nodes} nodes. Theory: Lagrange's
equations of the planar rod with θ(s, t) a polynomial of degree 11 in s, and Radau IIA of order 5 to 1e-8
in time. Error: root mean square over the frames of the tip's distance, in L. The error that remains at the
smallest steps is that of {nodes} nodes.</p>"""
    caption = "Refinement of the step: whipped hair against the independent integrator."
    return Study("A whipped hair", text, rows, [Plot(caption, draw)])
