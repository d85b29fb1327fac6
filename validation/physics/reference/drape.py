"""A heavy elastic strand that slides over a cylinder while one end hangs."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from ..arrays import FloatArray

Force = Callable[[float], tuple[float, float]]
"""Force across the section at an arc length, N."""


@dataclass(frozen=True)
class Drape:
    """The strand in the x-y plane, with the axis of the cylinder at the origin."""

    points: FloatArray
    """`n × 3`, m, from the span to the hanging end."""
    length: float
    """m"""
    span: float
    """Tension just beyond the cylinder, N."""
    hanging: float
    """Tension where the strand begins to hang, N."""


@dataclass(frozen=True)
class _FreePart:
    """Initial-value problems of the parts that are free, from the points where they leave the cylinder."""

    stiffness: float
    radius: float

    def solve(self, start: float, force: Force, length: float, direction: float) -> Any:
        """The part that begins at the polar angle `start`; `direction` is 1 or -1 along the strand."""

        def slope(s: float, y: FloatArray) -> FloatArray:
            fx, fy = force(s)
            c, n = np.cos(y[2]), np.sin(y[2])
            return direction * np.array([c, n, y[3], (n * fx - c * fy) / self.stiffness])

        radius = self.radius
        begin = [radius * np.cos(start), radius * np.sin(start), start - 0.5 * np.pi, -1 / radius]
        return solve_ivp(slope, (0, length), begin, rtol=1e-10, atol=1e-13, dense_output=True)


def drape(
    *,
    stiffness: float,
    weight: float,
    radius: float,
    mu: float,
    hangs: float,
    lies_to: float,
    spans: float,
    spacing: float,
) -> Drape:
    """A strand on a cylinder up to the polar angle `lies_to`, rad, with free lengths `hangs` and `spans`, m.

    `weight` is per length, N/m. Free parts: θ' = κ, EI κ' = −(t × F), F' = weight upwards, as initial-value
    problems from the points where they leave the cylinder with κ = −1/R. The unknowns are that point at the
    hanging end, whose tip bears no moment, and the shear force at the other end, such that the far span is
    bent by its weight alone, κ = weight/|F|. On the cylinder T' = µ (T/R + weight sin α) + weight cos α along
    the arc, plus µ times the shear at both ends.
    """
    free = _FreePart(stiffness, radius)

    def below(start: float) -> Any:
        return free.solve(start, lambda s: (0.0, -weight * (hangs - s)), hangs, 1.0)

    start = brentq(lambda a: below(a).y[3, -1], 0.4, 1.2, xtol=1e-14)
    hanging = weight * hangs * np.cos(start)
    tension = hanging + mu * weight * hangs * np.sin(start)
    on = solve_ivp(
        lambda a, t: mu * (t + weight * radius * np.sin(a)) + weight * radius * np.cos(a),
        (start, lies_to),
        [tension],
        rtol=1e-10,
    ).y[0, -1]

    def pull(shear: float) -> FloatArray:
        across = np.array([np.cos(lies_to), np.sin(lies_to)])
        force: FloatArray = (on + mu * shear) * np.array([across[1], -across[0]]) + shear * across
        return force

    def above(shear: float) -> Any:
        fx, fy = pull(shear)
        return free.solve(lies_to, lambda s: (fx, fy - weight * s), spans, -1.0)

    # The shear of a span that is not bent by its weight, with the tension on the cylinder: a lower bound.
    least = np.sqrt(stiffness / radius**2 * (on + 0.25 * stiffness / radius**2))
    shear = brentq(lambda q: above(q).y[3, -1] - weight / np.hypot(*pull(q)), least, 1.3 * least, xtol=1e-20)
    before = np.arange(0, spans, spacing)[::-1]
    angles = np.arange(lies_to, start, -spacing / radius)[1:]
    parts = [
        above(shear).sol(before)[:2].T,
        radius * np.stack([np.cos(angles), np.sin(angles)], axis=1),
        below(start).sol(np.linspace(0, hangs, round(hangs / spacing)))[:2].T,
    ]
    points = np.pad(np.concatenate(parts), ((0, 0), (0, 1)))
    return Drape(points, before[0] + radius * (lies_to - start) + hangs, on + mu * shear, hanging)
