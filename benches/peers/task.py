"""What every program is asked to do: a rod of Γ = 10 held out horizontally, sagging, its clamp then shaken for a second."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from physics.motion import shake
from physics.reference import planar
from physics.scene import GRAVITY

GAMMA = 10.0
LENGTH = 0.25
"""m"""
LINE_DENSITY = 1.0
"""kg/m. Motion depends on Γ, L and g alone; at a hair's own 5e-7 kg/m MuJoCo refuses inertias as too small."""
BENDING = LINE_DENSITY * GRAVITY * LENGTH**3 / GAMMA
"""EI, N·m²."""
DAMPING = 0.005
"""Kelvin-Voigt time, s."""
FPS = 25
FRAMES = 25
RODS = 200
TOLERANCE = 3e-3
"""Largest error of the tip that passes, in L."""


@dataclass(frozen=True)
class Accuracy:
    """Errors of the tip, in L."""

    rest: float
    """At rest, from the elastica."""
    motion: float
    """Root mean square over the frames of the shaken second, from the independent integrator."""


@cache
def rest() -> np.ndarray:
    """(x, y) of the tip at rest, m."""
    return planar.equilibrium(GAMMA).tip * LENGTH


@cache
def moving(damping: float) -> np.ndarray:
    """(x, y) of the tip at each frame of the shaken second, m, relative to the clamp: `frames × 2`."""
    start = planar.equilibrium(GAMMA)
    times = np.arange(FRAMES + 1) / FPS
    swing = planar.swing(
        length=LENGTH,
        bending=BENDING,
        line_density=LINE_DENSITY,
        gravity=GRAVITY,
        angle=lambda s: start.at(s)[0],
        clamp=shake,
        times=times,
        damping=damping,
        modes=7,
        tolerance=1e-6,
    )
    return swing.tip[1:] - [[shake(t)[0], 0.0] for t in times[1:]]


def accuracy(at_rest: np.ndarray, tips: np.ndarray, damping: float) -> Accuracy:
    """Errors of a program's tips: at rest, and at each frame relative to the clamp, m."""
    off = ((tips - moving(damping)) ** 2).sum(axis=1)
    return Accuracy(float(np.linalg.norm(at_rest - rest())) / LENGTH, float(np.sqrt(off.mean())) / LENGTH)


def gravity(t: float) -> np.ndarray:
    """Gravity in the frame of the clamp, (x, y): what shakes rods whose program has no moving clamp."""
    return np.array([-shake(t)[2], -GRAVITY])
