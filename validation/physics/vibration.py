"""Small free vibrations: frequencies, and the loss by the time schemes, the material and the air."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import HORIZONTAL, ISOLATED_DRAG, Rod, Scene, Strand

from .arrays import FloatArray
from .program import Hairbake
from .reference import modes as eigen
from .signal import strongest
from .study import SCHEMES, Plot, Row, Study, relative

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROOTS = (1.87510407, 4.69409113, 7.85475744)
"""Roots of cos x cosh x = −1."""
SIZE = 1e-3
"""Amplitude at the tip, in L: large against the rounding of the cache, small enough to be linear (1e-6)."""
STEPS = 400
"""Steps per period."""
LOSSES: dict[str, Callable[[float], float]] = {
    "backward-euler": lambda turn: turn / 2,
    "bdf2": lambda turn: turn**3 / 4,
    "four-step": lambda turn: turn**3 / 50,
}
"""Loss of amplitude per radian at an angle per step, to leading order (docs/theory.md §4.6)."""


def mode_shape(rod: Rod, mode: int, points: int = 65) -> FloatArray:
    """A straight strand along x, bent upwards as in its `mode`-th vibration."""
    s = np.linspace(0, 1, points)
    b = ROOTS[mode]
    c = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))
    shape = np.cosh(b * s) - np.cos(b * s) - c * (np.sinh(b * s) - np.sin(b * s))
    up = SIZE * shape / shape[-1]
    return rod.length * np.stack([s, up, 0 * s], axis=1)


def frequency(rod: Rod, mode: int) -> float:
    """Angular frequency of a clamped-free rod, rad/s."""
    return ROOTS[mode] ** 2 * float(np.sqrt(rod.bending[0] / rod.line_density)) / rod.length**2


def ring(hairbake: Hairbake, rod: Rod, mode: int, scheme: str, steps: int, periods: int = 4) -> complex:
    """Decay rate + i · frequency, 1/s, of a strand released in its `mode`-th shape, at `steps` per period."""
    rod = replace(rod, natural=(0.0, 0.0, 0.0))
    rate = steps * frequency(rod, mode) / (2 * np.pi)
    # A frame is a whole number of steps, with about 20 frames per period.
    substeps = max(1, steps // 20, int(np.ceil(rate / 1000)))
    frames = round(periods * steps / substeps)
    scene = Scene(
        [Strand(rod, mode_shape(rod, mode), HORIZONTAL)],
        fps=rate / substeps,
        substeps=substeps,
        frames=frames,
        settings={"scheme": scheme},
        gravity=(0.0, 0.0, 0.0),
        nodes=8,
    )
    bake = hairbake.bake(scene)
    return strongest(bake.times[1:], bake.points[0][1:, -1, 1], 3, frequency(rod, mode))


def frequencies(
    hairbake: Hairbake, modes: int = 3, refine: Sequence[int] = (20, 40, 80, 160, 320, 640)
) -> Study:
    """First frequencies, straight and pre-twisted, and the loss at `refine` steps per period."""
    rows = []
    for scheme in SCHEMES:
        for mode in range(modes):
            found = ring(hairbake, Rod(), mode, scheme, STEPS)
            name = f"mode {mode + 1}, {STEPS} steps a period, {scheme}: ω, rad/s"
            rows.append(relative(name, frequency(Rod(), mode), found.imag, 0.01))
        for k, (theory, measured) in enumerate(zip(*twisted(hairbake, scheme, modes), strict=True)):
            name = f"pre-twisted ribbon, mode {k + 1}, 16 nodes, {scheme}: ω, rad/s"
            rows.append(relative(name, theory, measured, 0.01))
    losses = {scheme: [ring(hairbake, Rod(), 0, scheme, n) for n in refine] for scheme in SCHEMES}
    rows += loss_rows(refine, losses)
    omega = frequency(Rod(), 0)

    def draw(axes: "Axes") -> None:
        for scheme, found in losses.items():
            loss, error = [p.real / omega for p in found], [abs(p.imag / omega - 1) for p in found]
            axes.loglog(refine, loss, "o-", label=f"{scheme}: loss per radian")
            axes.loglog(refine, error, "s--", label=f"{scheme}: frequency error")
        axes.set(xlabel="steps a period", ylabel="relative")
        axes.legend(fontsize=8)

    text = """<p>A straight strand of hair (8 nodes, no weight, no damping) is drawn in the shape of its
vibration, 1e-3 L high, and released. Frequency and decay are read from the tip's path (matrix pencil).
Theory: {1.8751², 4.6941², 7.8548²} √(EI/ρSL⁴); for the pre-twisted ribbon (EI2 = 4 EI1, half a turn from
root to tip) a Legendre-Galerkin eigenvalue problem.</p>"""
    caption = "Effect of the schemes on a free vibration: loss of first and of third order."
    return Study(
        "Free vibration: frequencies and the schemes' own damping", text, rows, [Plot(caption, draw)]
    )


def loss_rows(refine: Sequence[int], losses: dict[str, list[complex]]) -> list[Row]:
    """Loss per radian of each scheme against its leading-order theory."""
    omega = frequency(Rod(), 0)
    rows = []
    for scheme, found in losses.items():
        for n, pole in zip(refine, found, strict=True):
            turn = 2 * np.pi / n
            expected = LOSSES[scheme](turn)
            name = f"loss per radian, {n} steps a period, {scheme} (theory: leading order)"
            rows.append(relative(name, expected, pole.real / omega, None))
    return rows


def twisted(hairbake: Hairbake, scheme: str, count: int) -> tuple[FloatArray, FloatArray]:
    """First frequencies of a pre-twisted ribbon, rad/s: theory, and those of hairbake's tip."""
    ratio, turn = 4.0, np.pi
    rod = Rod(bending=(7.8e-9, 7.8e-9 * ratio))
    rod = replace(rod, natural=(0.0, 0.0, turn / rod.length))
    unit = np.sqrt(rod.bending[0] / rod.line_density) / rod.length**2
    theory = eigen.frequencies(count, ratio, turn) * unit
    # Drawn in the sum of the first three shapes of the straight rod, in a plane between the section axes.
    shape: FloatArray = sum(mode_shape(rod, m) * [0, 1, 0] for m in range(3)) + mode_shape(rod, 0) * [1, 0, 0]
    shape[:, 2] = 0.6 * shape[:, 1]
    rate = STEPS * theory[-1] / (2 * np.pi)
    substeps = STEPS // 25
    scene = Scene(
        [Strand(rod, shape, HORIZONTAL)],
        fps=rate / substeps,
        substeps=substeps,
        frames=round(25 * 6 * theory[-1] / theory[0]),
        settings={"scheme": scheme},
        gravity=(0.0, 0.0, 0.0),
        nodes=16,
    )
    bake = hairbake.bake(scene)
    heights = bake.points[0][2:, -1, 1]
    return theory, np.array([strongest(bake.times[2:], heights, 14, w).imag for w in theory])


def damping(hairbake: Hairbake, modes: int = 3) -> Study:
    """Decay by the damping of the material and by the air."""
    rows = []
    for scheme, steps in ((SCHEMES[0], 2000), (SCHEMES[-1], 400)):
        for mode in range(modes):
            rod = replace(Rod(), damping=0.005)
            decay = ring(hairbake, rod, mode, scheme, steps).real
            omega = frequency(rod, mode)
            # The scheme's own loss, to leading order (docs/theory.md §4.6); negligible here for four steps.
            own = omega * np.pi / steps if scheme == SCHEMES[0] else 0.0
            name = f"Kelvin-Voigt 5 ms, mode {mode + 1}, {scheme}: decay, 1/s"
            rows.append(relative(name, own + 0.5 * omega**2 * rod.damping, decay, 0.02))
            rod = replace(Rod(), drag=0.02)
            decay = ring(hairbake, rod, mode, scheme, steps).real
            name = f"air drag × 0.02, mode {mode + 1}, {scheme}: decay, 1/s"
            rows.append(relative(name, own + 0.02 * ISOLATED_DRAG / (2 * rod.line_density), decay, 0.02))
    text = """<p>The same vibrations with the damping of the material alone (Kelvin-Voigt time τ: decay
ω²τ/2) or in still air alone (drag c across the strand: decay c/2ρS). Backward Euler at 2000 steps a
period, with its own loss ω²h/2 added to the theory; the scheme of four steps at 400, without.</p>"""
    return Study("Damping: decay times", text, rows)
