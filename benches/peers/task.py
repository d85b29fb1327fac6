"""The task: a rod of Γ = 10 held out horizontally sags, then its clamp is shaken for a second."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from hairbake.rods import GRAVITY
from physics.arrays import FloatArray
from physics.reference import planar
from physics.whip import shake

GAMMA = 10.0
LENGTH = 0.25
"""m"""
LINE_DENSITY = 1.0
"""kg/m. Motion depends on Γ, L and g only; at a hair's own 5e-7 kg/m MuJoCo rejects inertias as too small."""
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
def rest() -> FloatArray:
    """(x, y) of the tip at rest, m."""
    return planar.equilibrium(GAMMA).tip * LENGTH


@cache
def moving(damping: float) -> FloatArray:
    """(x, y) of the tip at each frame of the shaken second relative to the clamp, `frames × 2`, m."""
    start = planar.equilibrium(GAMMA)
    times = np.arange(FRAMES + 1) / FPS
    swing = planar.swing(
        planar.PlanarRod(LENGTH, BENDING, LINE_DENSITY, damping=damping),
        gravity=GRAVITY,
        angle=lambda s: start.at(s)[0],
        clamp=shake,
        times=times,
        modes=7,
        tolerance=1e-6,
    )
    clamp = np.array([[shake(t)[0], 0.0] for t in times[1:]])
    tip: FloatArray = swing.tip[1:] - clamp
    return tip


def accuracy(at_rest: FloatArray, tips: FloatArray, damping: float) -> Accuracy:
    """Errors of a program's tips at rest and, relative to the clamp, at each frame, m."""
    squares = ((tips - moving(damping)) ** 2).sum(axis=1)
    return Accuracy(float(np.linalg.norm(at_rest - rest())) / LENGTH, float(np.sqrt(squares.mean())) / LENGTH)


def gravity(t: float) -> FloatArray:
    """Gravity in the frame of the shaken clamp, (x, y), for programs that have no moving clamp."""
    return np.array([-shake(t)[2], -GRAVITY])
