"""Dry friction: a strand that sticks to a plate until it slips, and one that lies across a slope."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import ALONG_Z, DOWN, GRAVITY, IDENTITY, Motion, Pose, Rod, Scene, Strand, straight

from .arrays import FloatArray
from .program import Hairbake
from .reference import column
from .study import SCHEMES, Plot, Row, Study, absolute, relative

if TYPE_CHECKING:
    from matplotlib.axes import Axes

THICKNESS = 5e-4
"""Distance kept from the plate, m."""
PLATE = {
    "name": "plate",
    "shape": {"type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0]},
    "thickness_m": THICKNESS,
}
ABOVE = 4 * THICKNESS
"""Height above the plate at which strands are drawn, m, so that all of the thickness is kept."""

THRESHOLDS = {0.01: 0.0449, 0.04: 0.0919, 0.10: 0.1528, 0.16: 0.2043, 0.25: 0.2807, 0.31: 0.3361}
"""|Ft/Fn| under the tip by the shortening, in L."""
PRESSED = 1e-3
"""Shortening, in L, from which a tip certainly presses on the plate."""
SLIPPED = 1e-4
"""Displacement of the tip, in L, from which it counts as slipped."""


def ramp(t: float, start: float, end: float) -> float:
    """0 before `start`, 1 after `end`, linear between."""
    return min(max((t - start) / (end - start), 0.0), 1.0)


@dataclass(frozen=True)
class Threshold:
    """Theory of the pressed strand: |Ft/Fn| against the shortening."""

    shortening: FloatArray
    """In L, increasing."""
    ratio: FloatArray

    @classmethod
    def up_to(cls, most: float) -> "Threshold":
        """Shortenings up to `most`."""
        fine = np.linspace(0.02, 1.0, 120) ** 2 * most
        return cls(fine, column.friction(fine))

    def at(self, shortening: float) -> float:
        """|Ft/Fn| at a shortening."""
        return float(np.interp(np.sqrt(shortening), np.sqrt(self.shortening), self.ratio))


@dataclass(frozen=True)
class Pressed:
    """One strand pressed on the plate."""

    mu: float
    moved: FloatArray
    """Displacement of the tip in every frame, in L."""
    slip: int
    """The first frame in which the tip has slipped; 0 for none."""
    onset: float
    """Shortening at which the tip slips, in L."""
    creep: float
    """Largest displacement of the tip up to 98 % of that shortening, in L."""

    @classmethod
    def read(cls, mu: float, tip: FloatArray, length: float, shortening: FloatArray) -> "Pressed":
        """From the path of the tip along x, m."""
        touching = int(np.argmax(shortening > PRESSED))
        moved = np.abs(tip - tip[touching]) / length
        slip = int(np.argmax(moved > SLIPPED))
        onset = float(np.sqrt(shortening[slip] * shortening[slip - 1])) if slip else float("nan")
        sticking = (shortening > PRESSED) & (shortening < 0.98 * onset)
        creep = float(moved[sticking].max()) if sticking.any() else float("nan")
        return cls(mu, moved, slip, onset, creep)


def pressed_scene(mus: Sequence[float], shortest: float, most: float, steps: int, nodes: int) -> Scene:
    """One strand for each friction coefficient, pressed down by `most` lengths in `steps` steps."""
    rod = Rod()
    strands = []
    for i, mu in enumerate(mus):
        rod = Rod(friction=mu)
        root = (0.0, rod.length + ABOVE, 2 * i * rod.length)
        strands.append(Strand(rod, straight(rod, (0, -1, 0), root), DOWN))

    def lowered(t: float) -> Pose:
        height = -(ABOVE - THICKNESS) * ramp(t, -10, 0) - most * rod.length * ramp(t, 0, steps) ** 2
        return np.array([0.0, height, 0.0]), IDENTITY

    # A slight lateral force selects the direction of buckling; it ends before the first tip slips.
    push = 1e-3 * rod.bending[0] / (rod.line_density * rod.length**3)
    over = steps * 0.5 * np.sqrt(shortest / most)
    return Scene(
        strands,
        frames=steps,
        fps=1.0,
        substeps=1,
        preroll=20,
        nodes=nodes,
        gravity=(0, 0, 0),
        force={"frames": [-30, 0.8 * over, over], "values": [[push, 0, 0], [push, 0, 0], [0, 0, 0]]},
        motion=lowered,
        colliders=[PLATE],
        settings={"scheme": SCHEMES[0]},
    )


def stick_slip(
    hairbake: Hairbake, shortenings: Sequence[float] = tuple(THRESHOLDS), steps: int = 600, nodes: int = 16
) -> Study:
    """A strand on a plate, pressed until its tip slips."""
    most = 1.15 * max(shortenings)
    threshold = Threshold.up_to(most)
    theory = [threshold.at(e) for e in shortenings]
    mus = [THRESHOLDS.get(e, ratio) for e, ratio in zip(shortenings, theory, strict=True)]
    bake = hairbake.bake(pressed_scene(mus, min(shortenings), most, steps, nodes))
    shortening = most * np.clip(bake.times / steps, 0, 1) ** 2
    rows, found = [], []
    for e, ratio, mu, points in zip(shortenings, theory, mus, bake.points, strict=True):
        pressed = Pressed.read(mu, points[:, -1, 0], Rod().length, shortening)
        rows.append(relative(f"|Ft/Fn| at ε = {e:g}, theory against published", THRESHOLDS[e], ratio, 2e-3))
        measured = threshold.at(pressed.onset)
        rows.append(relative(f"µ = {mu:g}: |Ft/Fn| where it slips", mu, measured, 0.01))
        rows.append(absolute(f"µ = {mu:g}: creep while it sticks, L", pressed.creep, 1e-9))
        found.append(pressed)

    text = f"""<p>A weightless strand is clamped straight above a plate, its tip free to turn on it, and
the clamp is lowered slowly, by ε L. It buckles; its tip stands still until |Ft/Fn| of the clamped-pinned
elastica (boundary-value solver, 1e-8) is µ, then slips. hairbake: one backward Euler step of a second
each, {steps} steps. Creep is the largest motion of the tip up to 98 % of the ε at which it slips.</p>"""
    return Study("Stick and slip", text, rows, stick_slip_plots(threshold, shortening, found))


def stick_slip_plots(threshold: Threshold, shortening: FloatArray, found: list[Pressed]) -> list[Plot]:
    """Where tips slip, and their displacement."""

    def draw_theory(axes: "Axes") -> None:
        axes.plot(threshold.shortening, threshold.ratio, "k-", label="elastica")
        mus = [pressed.mu for pressed in found]
        axes.plot(
            [np.interp(mu, threshold.ratio, threshold.shortening) for mu in mus], mus, "o", markersize=3
        )
        for pressed in found:
            axes.plot(shortening[pressed.slip], pressed.mu, "x", label=f"µ = {pressed.mu:g} slips")
        axes.set(xlabel="clamp lowered by / L", ylabel="|Ft/Fn|")
        axes.legend(fontsize=7)

    def draw_moved(axes: "Axes") -> None:
        for pressed in found:
            axes.semilogy(shortening, np.maximum(pressed.moved, 1e-13), label=f"µ = {pressed.mu:g}")
        axes.set(xlabel="clamp lowered by / L", ylabel="tip moved / L")
        axes.legend(fontsize=7)

    return [Plot("Where tips slip.", draw_theory), Plot("Tips stand still, then slip.", draw_moved)]


def free_acceleration(ratio: float, mu: float) -> float:
    """Acceleration down a slope whose tangent is `ratio` · µ, m/s²; 0 if friction holds."""
    slope = np.arctan(ratio * mu)
    return max(0.0, float(GRAVITY * (np.sin(slope) - mu * np.cos(slope))))


def incline_scene(rod: Rod, ratio: float, substeps: int, nodes: int) -> Scene:
    """A strand across a slope, whose clamp slides down by the exact law."""
    slope = np.arctan(ratio * rod.friction)
    free = free_acceleration(ratio, rod.friction)

    def motion(t: float) -> Pose:
        return np.array([0.5 * free * max(t, 0.0) ** 2, -THICKNESS * ramp(t, -0.5, -0.2), 0.0]), IDENTITY

    return Scene(
        [Strand(rod, straight(rod, (0, 0, 1), (0, 2 * THICKNESS, 0)), ALONG_Z)],
        frames=20,
        fps=100.0,
        substeps=substeps,
        preroll=1.0,
        nodes=nodes,
        gravity=(0.0, -GRAVITY * np.cos(slope), 0.0),
        force={"frames": [-0.01, 0], "values": [[0, 0, 0], [GRAVITY * np.sin(slope), 0, 0]]},
        motion=motion,
        colliders=[PLATE],
    )


def incline_rows(bake: Motion, rod: Rod, ratio: float) -> list[Row]:
    """Displacement of a strand that holds, or acceleration of one that slides."""
    away = bake.points[0][..., 0]
    free = free_acceleration(ratio, rod.friction)
    if free == 0.0:
        moved = float(np.abs(away).max() / rod.length)
        return [absolute(f"slope of {ratio:g} µ: moved, L", moved, 1e-9)]
    outer = bake.velocities[0][-1, away.shape[1] // 2 :, 0] / bake.times[-1]
    mean = relative(
        f"slope of {ratio:g} µ: acceleration, mean of the outer half", free, float(outer.mean()), 0.01
    )
    name = f"slope of {ratio:g} µ: acceleration, worst point of the outer half"
    worst = f"{outer[np.abs(outer - free).argmax()]:.6g}"
    return [mean, Row(name, f"{free:.6g}", worst, float(np.abs(outer / free - 1).max()), None)]


def incline(
    hairbake: Hairbake,
    ratios: Sequence[float] = (0.9, 0.99, 1.01, 1.2, 2.0),
    substeps: int = 16,
    nodes: int = 16,
) -> Study:
    """A strand across a slope holds below the angle of friction and slides above it."""
    rod = Rod(friction=0.3)
    rows, curves = [], []
    for ratio in ratios:
        bake = hairbake.bake(incline_scene(rod, ratio, substeps, nodes))
        rows += incline_rows(bake, rod, ratio)
        exact = 0.5 * free_acceleration(ratio, rod.friction) * np.maximum(bake.times, 0) ** 2
        curves.append((ratio, bake.times, exact, bake.points[0][:, -1, 0]))

    def draw(axes: "Axes") -> None:
        for ratio, times, exact, tip in curves:
            line = axes.plot(times, 1e3 * tip, "o", markersize=3, label=f"{ratio:g} µ")[0]
            axes.plot(times, 1e3 * exact, "-", linewidth=0.8, color=line.get_color())
        axes.set(xlabel="t, s", ylabel="tip, mm")
        axes.legend(fontsize=7)

    text = f"""<p>A 25 cm hair (µ = {rod.friction:g}) lies on a plate across the direction in which gravity
is then tilted. A guide is clamped at its root, so the clamp moves by the exact law, s = ½ g (sin α − µ cos
α) t². A strand under the right friction stays straight; any other one bends, because it is too flexible (Γ
= 130) to be dragged along. Measured: the displacement below the angle of friction, and above it the
acceleration of the outer half.</p>"""
    return Study("A strand on a slope", text, rows, [Plot("Lines: theory; dots: tips.", draw)])
