"""PyElastica: Cosserat rods, explicit in time."""

import time
from dataclasses import dataclass

import elastica as ea
import numpy as np

from . import task


class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):
    """What a rod here needs."""


class Pull(ea.NoForces):
    """Gravity in the frame of the clamp, common to all rods."""

    def __init__(self, acceleration: np.ndarray):
        super().__init__()
        self.acceleration = acceleration

    def apply_forces(self, system, time=0.0):
        system.external_forces += self.acceleration[:, None] * system.mass


@dataclass(frozen=True)
class ElasticaRods:
    """`elements` elements. Own clamp: the first element is held. Consistent: that element is half as long as the others. It has
    no Kelvin-Voigt damping: the motion is that without.
    """

    elements: int
    substeps: int
    consistent: bool
    radius: float
    """m. The bending stiffness is kept; a thick rod's stretching is softer and allows longer steps, but costs accuracy."""
    name = "PyElastica"
    damping = 0.0

    @property
    def clamp(self) -> str:
        return "consistent" if self.consistent else "own"

    def build(self, rods: int, damped: float) -> tuple[Simulator, list, np.ndarray]:
        """A simulator of rods held out horizontally, the rods, and the acceleration that pulls them."""
        simulator, pull, made = Simulator(), np.zeros(3), []
        l = task.LENGTH / self.elements
        nodes = np.arange(self.elements + 1) * l
        if self.consistent:
            nodes = np.concatenate([[0.0], (np.arange(self.elements) + 0.5) * l, [task.LENGTH]])
        area, inertia = np.pi * self.radius**2, np.pi / 4 * self.radius**4
        for _ in range(rods):
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
                # The joints next to the half elements stand for a whole length l, not for the ¾ l between their neighbours' middles.
                rod.bend_matrix[..., [0, -1]] *= 0.75
            simulator.append(rod)
            simulator.constrain(rod).using(
                ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,)
            )
            simulator.add_forcing_to(rod).using(Pull, acceleration=pull)
            if damped:
                simulator.dampen(rod).using(
                    ea.AnalyticalLinearDamper, uniform_damping_constant=damped, time_step=self.step
                )
            made.append(rod)
        simulator.finalize()
        return simulator, made, pull

    @property
    def step(self) -> float:
        return 1 / (task.FPS * self.substeps)

    def _run(self, simulator: Simulator, pull: np.ndarray, start: float, steps: int, still: bool) -> None:
        stepper, t = ea.PositionVerlet(), np.float64(start)
        for i in range(steps):
            pull[:2] = task.gravity(0.0 if still else start + (i + 0.5) * self.step)
            t = stepper.step(simulator, t, np.float64(self.step))

    def accuracy(self) -> task.Accuracy:
        """Errors of one rod; not a number where it blows up."""
        with np.errstate(all="ignore"):
            simulator, (still,), pull = self.build(1, damped=8.0)
            self._run(simulator, pull, 0.0, round(3.0 / self.step), still=True)
            at_rest = still.position_collection[:2, -1].copy()
            simulator, (rod,), pull = self.build(1, damped=0.0)
            rod.position_collection[:] = still.position_collection
            rod.director_collection[:] = still.director_collection
            tips = []
            for frame in range(task.FRAMES):
                self._run(simulator, pull, frame / task.FPS, self.substeps, still=False)
                tips.append(rod.position_collection[:2, -1].copy())
            return task.accuracy(at_rest, np.array(tips), self.damping)

    def seconds(self) -> float:
        """CPU seconds a frame for all rods in one simulator, which steps them as one block."""
        simulator, _, pull = self.build(task.RODS, damped=0.0)
        self._run(simulator, pull, 0.0, 2, still=False)
        steps = 40
        start = time.process_time()
        self._run(simulator, pull, 0.0, steps, still=False)
        return (time.process_time() - start) / steps * self.substeps
