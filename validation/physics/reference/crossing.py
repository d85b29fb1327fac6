"""Two rods at rest, one on the other: Kirchhoff's equations in space with a contact without friction."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from ..arrays import FloatArray

UP = np.array([0.0, 1.0, 0.0])
STAGES = (0.1, 0.3, 0.6, 1.0)
"""Shares through which the loads, then the height of the upper root, are continued."""
FIRST_FORCE = 0.3
"""Contact force of the first stages, in weights of the upper rod."""

Distance = Callable[[float], float]
"""Distance of the centrelines, m, by the sine of the angle between the rods."""


@dataclass(frozen=True)
class RoundRod:
    """A naturally straight, inextensible rod of circular section, clamped at its root, SI units."""

    origin: FloatArray
    """Position of the root."""
    direction: FloatArray
    """Unit vector of the clamp, horizontal."""
    length: float
    stiffness: float
    """EI."""
    weight: float
    """Weight per length."""

    def across(self) -> FloatArray:
        """Two unit vectors across the clamp, in rows: up and sideways."""
        return np.array([UP, np.cross(self.direction, UP)])


@dataclass(frozen=True)
class Part:
    """One of the two rods at rest."""

    contact: float
    """Arc length of the contact, m."""
    force: FloatArray
    """Force of the other rod, N."""
    solutions: tuple[Any, Any]
    """From the root to the contact, and from there to the tip."""

    def at(self, s: FloatArray) -> FloatArray:
        """Positions, `n × 3`, m, at arc lengths `s`."""
        before, beyond = (solved(s)[:3].T for solved in self.solutions)
        points: FloatArray = np.where((s < self.contact)[:, None], before, beyond)
        return points


@dataclass(frozen=True)
class Crossing:
    """Two rods at rest."""

    lower: Part
    upper: Part

    @property
    def force(self) -> float:
        """Contact force, N."""
        return float(np.linalg.norm(self.upper.force))


def _bend(rod: RoundRod, moment: FloatArray, contact: float, force: FloatArray, weight: float) -> Part:
    """The rod with a root `moment`, N·m, about the two directions across the clamp.

    r' = t, t' = M × t / EI, M' = −t × n with the force n across the section. A free end bears no torque, so M
    stays normal to t.
    """
    tip_weight = -weight * UP

    def slope(s: float, y: FloatArray, pushed: float) -> FloatArray:
        t, m = y[3:6], y[6:9]
        n = tip_weight * (rod.length - s) + pushed * force
        return np.concatenate([t, np.cross(m, t) / rod.stiffness, -np.cross(t, n)])

    start = np.concatenate([rod.origin, rod.direction, moment @ rod.across()])

    def solve(span: tuple[float, float], begin: FloatArray, pushed: float) -> Any:
        def slope_here(s: float, y: FloatArray) -> FloatArray:
            return slope(s, y, pushed)

        return solve_ivp(slope_here, span, begin, "DOP853", rtol=1e-10, atol=1e-14, dense_output=True)

    before = solve((0.0, contact), start, 1.0)
    beyond = solve((contact, rod.length), before.y[:, -1], 0.0)
    return Part(contact, force, (before.sol, beyond.sol))


def rest(lower: RoundRod, upper: RoundRod, distance: Distance, touching: tuple[float, float]) -> Crossing:
    """The equilibrium of `upper` lying on `lower` at a distance of the centrelines.

    Unknowns are both root moments, the arc lengths of the contact, at first `touching`, m, the contact force
    on the upper rod, and by how much the upper root is raised. Tips bear no moment; the line between the
    contact points has the length `distance`, is normal to both rods, and bears the force. With the raised
    root a force is prescribed; then the root returns.

    Raises:
        ArithmeticError: The solver does not converge, or the rods do not touch.
    """
    rods = (lower, upper)
    unit = np.array([rod.weight * rod.length for rod in rods])
    moments = np.repeat(unit * [rod.length for rod in rods], 2)
    scale = np.concatenate([moments, [upper.length] * 2, [unit[1]] * 3, [upper.length]])

    def parts(unknowns: FloatArray, share: float) -> list[Part]:
        x = unknowns * scale
        raised = (lower, replace(upper, origin=upper.origin + x[9] * UP))
        return [
            _bend(rod, x[2 * i : 2 * i + 2], x[4 + i], (2 * i - 1) * x[6:9], share * rod.weight)
            for i, rod in enumerate(raised)
        ]

    def contact(unknowns: FloatArray, share: float) -> FloatArray:
        """Nine residuals."""
        solved = parts(unknowns, share)
        states = [part.solutions[0](part.contact) for part in solved]
        apart = states[1][:3] - states[0][:3]
        wanted = distance(float(np.linalg.norm(np.cross(states[0][3:6], states[1][3:6]))))
        tips = [
            rod.across() @ part.solutions[1](rod.length)[6:9] for rod, part in zip(rods, solved, strict=True)
        ]
        along = [apart @ state[3:6] / upper.length for state in states]
        # The force is parallel to the line, which is nearly vertical: two components.
        turned = np.cross(unknowns[6:9], apart / wanted)[[0, 2]]
        missing = [apart @ apart / wanted**2 - 1]
        return np.concatenate([np.concatenate(tips) / moments, along, missing, turned])

    def loaded(unknowns: FloatArray, share: float) -> FloatArray:
        return np.append(contact(unknowns, share), np.linalg.norm(unknowns[6:9]) - share * FIRST_FORCE)

    def lowered(unknowns: FloatArray, height: float) -> FloatArray:
        return np.append(contact(unknowns, 1.0), unknowns[9] - height)

    def solve(
        residual: Callable[[FloatArray, float], FloatArray], start: FloatArray, at: float
    ) -> FloatArray:
        solved = root(residual, start, args=(at,), method="hybr", tol=1e-12)
        if np.abs(solved.fun).max() > 1e-8:
            raise ArithmeticError(solved.message)
        found: FloatArray = solved.x
        return found

    level_gap = (distance(1.0) - (upper.origin - lower.origin) @ UP) / upper.length
    unknowns = np.concatenate([[0.0] * 4, np.array(touching) / upper.length, [0.0] * 3, [level_gap]])
    for share in STAGES:
        unknowns[7] = share * FIRST_FORCE
        unknowns = solve(loaded, unknowns, share)
    raised = unknowns[9]
    for share in STAGES:
        unknowns = solve(lowered, unknowns, (1.0 - share) * raised)
    if unknowns[7] <= 0:
        raise ArithmeticError("the rods do not touch")
    return Crossing(*parts(unknowns, 1.0))
