"""PyElastica: Cosserat rods with explicit time steps."""

import time
from dataclasses import dataclass
from typing import Any

import elastica as ea
import numpy as np

from physics.arrays import FloatArray

from . import task


class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):  # type: ignore[misc]
    """A collection of rods with clamps, forces and damping."""


class FrameGravity(ea.NoForces):  # type: ignore[misc]
    """Gravity in the frame of the clamp, common to all rods."""

    def __init__(self, acceleration: FloatArray) -> None:
        """Gravity of this acceleration, which the caller updates in place."""
        super().__init__()
        self.acceleration = acceleration

    def apply_forces(self, system: Any, time: float = 0.0) -> None:
        """Adds the weight of each node."""
        system.external_forces += self.acceleration[:, None] * system.mass


@dataclass(frozen=True)
class Rods:
    """Rods in one simulator, held out horizontally."""

    simulator: Simulator
    rods: list[Any]
    gravity: FloatArray
    """Acceleration of gravity in the frame of the clamp, m/s², updated before every step."""
    step: float
    """s"""

    def run(self, start: float, steps: int, still: bool) -> None:
        """Takes `steps` steps from the time `start`, with the clamp at rest if `still`, else shaken."""
        stepper, t = ea.PositionVerlet(), np.float64(start)
        for i in range(steps):
            self.gravity[:2] = task.gravity(0.0 if still else start + (i + 0.5) * self.step)
            t = stepper.step(self.simulator, t, np.float64(self.step))


@dataclass(frozen=True)
class ElasticaRods:
    """Rods of `elements` elements.

    Own clamp: the first element is held. Consistent clamp: that element has half the length of the others.
    There is no Kelvin-Voigt damping: the reference motion is undamped.
    """

    elements: int
    substeps: int
    consistent: bool
    radius: float
    """m. Bending stiffness is fixed: a thick rod is softer in stretch: longer steps, more error."""
    name = "PyElastica"
    damping = 0.0

    @property
    def clamp(self) -> str:
        """Kind of clamp."""
        return "consistent" if self.consistent else "own"

    @property
    def step(self) -> float:
        """Time step, s."""
        return 1 / (task.FPS * self.substeps)

    def build(self, count: int, damped: float) -> Rods:
        """Straight rods, with external damping of the rate `damped`, 1/s."""
        simulator, gravity = Simulator(), np.zeros(3)
        rods = [self._straight_rod() for _ in range(count)]
        for rod in rods:
            simulator.append(rod)
            simulator.constrain(rod).using(
                ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,)
            )
            simulator.add_forcing_to(rod).using(FrameGravity, acceleration=gravity)
            if damped:
                simulator.dampen(rod).using(
                    ea.AnalyticalLinearDamper, uniform_damping_constant=damped, time_step=self.step
                )
        simulator.finalize()
        return Rods(simulator, rods, gravity, self.step)

    def _straight_rod(self) -> Any:
        length = task.LENGTH / self.elements
        nodes = np.arange(self.elements + 1) * length
        if self.consistent:
            nodes = np.concatenate([[0.0], (np.arange(self.elements) + 0.5) * length, [task.LENGTH]])
        area, inertia = np.pi * self.radius**2, np.pi / 4 * self.radius**4
        rod = ea.CosseratRod.straight_rod(
            nodes.size - 1,
            np.zeros(3),
            np.array([1.0, 0, 0]),
            np.array([0.0, 0, 1]),
            task.LENGTH,
            self.radius,
            task.LINE_DENSITY / area,
            youngs_modulus=task.BENDING / inertia,
            shear_modulus=task.BENDING / inertia / 3,
            position=np.stack([nodes, 0 * nodes, 0 * nodes]),
        )
        if self.consistent:
            # Joints next to the half elements represent a whole length, not ¾ of it, the distance of
            # midpoints.
            rod.bend_matrix[..., [0, -1]] *= 0.75
        return rod

    def accuracy(self) -> task.Accuracy:
        """Errors of one rod; NaN if it diverges."""
        with np.errstate(all="ignore"):
            settled = self.build(1, damped=8.0)
            settled.run(0.0, round(3.0 / self.step), still=True)
            (still,) = settled.rods
            at_rest = still.position_collection[:2, -1].copy()
            moving = self.build(1, damped=0.0)
            (rod,) = moving.rods
            rod.position_collection[:] = still.position_collection
            rod.director_collection[:] = still.director_collection
            tips = []
            for frame in range(task.FRAMES):
                moving.run(frame / task.FPS, self.substeps, still=False)
                tips.append(rod.position_collection[:2, -1].copy())
            return task.accuracy(at_rest, np.array(tips), self.damping)

    def seconds(self) -> float:
        """CPU seconds per frame for all rods in one simulator, which steps them as one block."""
        rods = self.build(task.RODS, damped=0.0)
        rods.run(0.0, 2, still=False)
        steps = 40
        start = time.process_time()
        rods.run(0.0, steps, still=False)
        return (time.process_time() - start) / steps * self.substeps
