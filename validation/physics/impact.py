"""The rigid law in motion: one cantilever falls on another."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import ALONG_Z, GRAVITY, HORIZONTAL, Motion, Rod, Scene, Strand, straight

from .arrays import FloatArray
from .energy import total_energy
from .pairs import closest
from .program import Hairbake
from .reference.impact import Cantilever, Swing, swing
from .study import Plot, Row, Study, absolute, order

if TYPE_CHECKING:
    from matplotlib.axes import Axes

UPPER, LOWER = 0.04, 0.02
"""Lengths of the two hairs, m."""
CONTACT = 0.75
"""Share of both lengths at which they cross."""
GAP = 1e-4
"""Distance between them as drawn, beyond that which they keep, m."""
LOAD = 0.25 * GRAVITY
"""Acceleration downwards, m/s²: slopes stay below 0.04, and theory is linear."""
DISTANCE = 2 * Rod().radius * (1 + 1 / math.sqrt(0.6))
"""Distance that single hairs keep at a right angle, m: (5.10)."""
SECONDS = 0.1
FRAMES = 1000.0
"""Most frames a second."""
DAMPING = 0.005
"""Kelvin-Voigt time of damped hairs, s."""
MODES = 24
"""Modes of each hair in theory."""
SOON = 0.02
"""Time, s, up to which theory is sure without damping, to 1e-3. Later motion depends on single impacts."""


def hair(length: float, damping: float) -> Rod:
    """A hair without friction, in no air."""
    return Rod(length=length, damping=damping, friction=0.0)


def scene(damping: float, steps: int, nodes: int) -> Scene:
    """Both hairs, level, released at time 0, with `steps` steps a second."""
    lower, upper = hair(LOWER, damping), hair(UPPER, damping)
    root = (CONTACT * LOWER, DISTANCE + GAP, -CONTACT * UPPER)
    fps = min(FRAMES, float(steps))
    return Scene(
        [
            Strand(upper, straight(upper, (0, 0, 1), root), ALONG_Z),
            Strand(lower, straight(lower, (1, 0, 0)), HORIZONTAL),
        ],
        frames=round(SECONDS * fps),
        fps=fps,
        substeps=round(steps / fps),
        nodes=nodes,
        gravity=(0.0, -LOAD, 0.0),
        settings={"contact": "full"},
    )


def theory(damping: float, step: float = 1e-6, modes: int = MODES) -> Swing:
    """Both hairs by modes."""

    def cantilever(length: float) -> Cantilever:
        rod = hair(length, damping)
        return Cantilever(length, rod.bending[0], rod.line_density, damping, CONTACT * length)

    times = np.arange(round(SECONDS * FRAMES) + 1) / FRAMES
    return swing((cantilever(UPPER), cantilever(LOWER)), GAP, LOAD, times, step=step, modes=modes)


@dataclass(frozen=True)
class Fall:
    """A bake of the hairs."""

    steps: int
    """Steps a second."""
    times: FloatArray
    tip: FloatArray
    """Displacement of the upper tip, m."""
    energy: FloatArray
    """Energy gained since the start, J."""
    least: float
    """Least distance of the hairs, over that which they are to keep."""

    @classmethod
    def read(cls, steps: int, damping: float, bake: Motion) -> "Fall":
        """The motion of a bake."""
        total = sum(
            total_energy(points, velocities, hair(length, damping), LOAD)
            for points, velocities, length in zip(bake.points, bake.velocities, (UPPER, LOWER), strict=True)
        )
        energy = np.asarray(total)
        least = min(closest(a, b).distance for a, b in zip(*bake.points, strict=True))
        tip = bake.points[0][:, -1, 1]
        return cls(steps, bake.times, tip - tip[0], energy - energy[0], least / DISTANCE)

    def error(self, exact: Swing, until: float = SECONDS) -> float:
        """R.m.s. error of the upper tip up to a time, s, over its r.m.s. displacement."""
        upto = self.times < until + 1e-9
        tip = np.interp(self.times[upto], exact.times, exact.upper)
        return float(np.sqrt(((self.tip[upto] - tip) ** 2).mean() / (tip**2).mean()))


def fall_rows(name: str, falls: Sequence[Fall], exact: Swing) -> list[Row]:
    """Energy gained and least distance, the worst of all steps."""
    kinetic = float(exact.kinetic.max())
    gain = max(float(fall.energy.max()) for fall in falls) / kinetic
    least = min(fall.least for fall in falls)
    return [
        Row(f"{name}: energy gained, most of all steps, in kinetic energy", "0", gain, max(gain, 0.0), 0.01),
        Row(f"{name}: distance, least of all steps", 1.0, least, max(1.0 - least, 0.0), 0.01),
    ]


def falling(name: str, errors: Sequence[float]) -> Row:
    """A row of the largest ratio of an error to that of the next longer step."""
    ratio = max(fine / coarse for coarse, fine in itertools.pairwise(errors))
    return Row(f"{name}: error over that of twice the step, largest", "below 1", ratio, ratio, 1.0)


def study(
    hairbake: Hairbake, steps: Sequence[int] = (500, 1000, 2000, 4000, 8000, 16000), nodes: int = 16
) -> Study:
    """A hair that falls on another one, damped and undamped."""
    damped, undamped = theory(DAMPING), theory(0.0)

    def falls(damping: float) -> list[Fall]:
        return [Fall.read(n, damping, hairbake.bake(scene(damping, n, nodes))) for n in steps]

    damped_falls, undamped_falls = falls(DAMPING), falls(0.0)
    # Linear theory errs by the square of the slope; of the distance half a per cent may be missing.
    size = float(np.sqrt((damped.upper**2).mean()))
    goal = 0.04**2 + 0.005 * DISTANCE / size
    errors = [fall.error(damped) for fall in damped_falls]
    rows = [
        absolute(f"damped, {n} steps/s: tip, r.m.s.", error, goal if n == 16000 else None)
        for n, error in zip(steps, errors, strict=True)
    ]
    # Hairs in contact take backward Euler steps.
    rows.append(
        absolute("damped: order of convergence, less 1", order([1 / n for n in steps], errors) - 1, 0.2)
    )
    rows += [falling("damped", errors), *fall_rows("damped", damped_falls, damped)]
    soon = [fall.error(undamped, SOON) for fall in undamped_falls]
    rows += [
        absolute(f"undamped, {n} steps/s: tip up to {1e3 * SOON:g} ms, r.m.s.", error, None)
        for n, error in zip(steps, soon, strict=True)
    ]
    rows += [falling("undamped", soon), *fall_rows("undamped", undamped_falls, undamped)]
    late = undamped_falls[-1].error(undamped)
    rows.append(
        absolute(f"undamped, {steps[-1]} steps/s: tip up to {1e3 * SECONDS:g} ms, r.m.s.", late, None)
    )

    def motion(exact: Swing, found: Sequence[Fall]) -> Callable[["Axes"], None]:
        def draw(axes: "Axes") -> None:
            axes.plot(1e3 * exact.times, 1e3 * exact.upper, "k-", linewidth=1.5, label="modes")
            for fall in found:
                axes.plot(1e3 * fall.times, 1e3 * fall.tip, linewidth=0.8, label=f"{fall.steps} steps/s")
            axes.set(xlabel="t, ms", ylabel="upper tip, mm")
            axes.legend(fontsize=7)

        return draw

    def draw_errors(axes: "Axes") -> None:
        axes.loglog(steps, errors, "o-", label="damped")
        axes.loglog(steps, soon, "s-", label=f"undamped, first {1e3 * SOON:g} ms")
        axes.set(xlabel="steps a second", ylabel="tip, relative r.m.s. error")
        axes.legend(fontsize=7)

    text = f"""<p>A hair of {100 * UPPER:g} cm, level, is released {1e3 * GAP:g} mm above another one of
{100 * LOWER:g} cm across it, and falls on it (<code>--contact full</code>, {nodes} nodes, no air, no
friction, a quarter of gravity). Theory: {MODES} modes of each cantilever, each solved exactly over steps of
1 µs, with Moreau's unilateral contact that restores nothing. With damping of {1e3 * DAMPING:g} ms it has
converged to 1e-4 in modes and steps. Without damping the hairs hit each other many times: theory has
converged to 1e-3 up to {1e3 * SOON:g} ms, and to 3 % up to {1e3 * SECONDS:g} ms, so that the later motion
is for information. Energies are read from the cache by splines; its velocities are differences over a frame,
which next to an impact are off by some 1e-3 of the kinetic energy before it.</p>"""
    plots = [
        Plot(f"With damping of {1e3 * DAMPING:g} ms.", motion(damped, damped_falls)),
        Plot("Without damping.", motion(undamped, undamped_falls)),
        Plot("Convergence with the step.", draw_errors),
    ]
    return Study("Crossed cantilevers", text, rows, plots)
