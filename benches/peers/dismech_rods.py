"""DiSMech-Newton: discrete elastic rods with implicit time steps, on the processor."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from physics.arrays import FloatArray

from . import task

# Its annotations join warp structs by |, which Python before 3.14 evaluates and such structs do not have.
setattr(type(wp.struct(type("Any", (), {}))), "__or__", lambda struct, _: struct)  # noqa: B010
wp.config.log_level = wp.LOG_ERROR

from dismech_newton import DiSMechSolver, add_rod, fix_segment  # noqa: E402
from newton import ModelBuilder, Rod  # noqa: E402

RADIUS = 0.005
"""Radius of the segments, m; it enters the inertia of twist only."""
STRETCH = 3e5
"""Axial stiffness of a segment, N/m. Of 1e5, 3e5 and 1e6 that with the least error in motion."""


@dataclass
class Rods:
    """Rods in one solver."""

    solver: Any
    states: list[Any]
    """At the start of the step and at its end."""

    def step(self, t: float, h: float) -> None:
        """Takes a step of `h`, s, with gravity in the frame of the clamp as at time `t`, s."""
        x, y = task.gravity(t)
        self.solver.model.gravity.assign(np.array([[x, 0.0, y]], dtype=np.float32))
        self.solver.step(*self.states, None, None, h)
        self.states.reverse()

    def step_frame(self, frame: int, steps: int) -> None:
        """Takes the steps of a frame of the shaken second, with gravity at the middle of each."""
        h = 1 / (task.FPS * steps)
        for step in range(steps):
            self.step(frame / task.FPS + (step + 0.5) * h, h)


@dataclass(frozen=True)
class DismechRods:
    """Rods of `elements` elements with a consistent clamp: the first and last segments have half the length.

    Steps are by the implicit midpoint rule, with one Newton iteration, which is enough.
    """

    elements: int
    substeps: int
    name = "DiSMech"
    clamp = "consistent"
    damping = task.DAMPING

    def build(self, count: int) -> Rods:
        """Straight rods."""
        length = task.LENGTH / self.elements
        ends = np.concatenate([[0.0], (np.arange(self.elements) + 0.5) * length, [task.LENGTH]])
        points = np.stack([ends, 0 * ends, 0 * ends], axis=1)
        stiffness = task.BENDING / length
        section = ModelBuilder.ShapeConfig(density=task.LINE_DENSITY / (np.pi * RADIUS**2))
        builder = ModelBuilder()
        for _ in range(count):
            first, *_ = add_rod(
                builder,
                Rod(points, radius=RADIUS),
                cfg=section,
                stretch_stiffness=STRETCH,
                bend_stiffness=stiffness,
                bend_damping=stiffness * self.damping,
                proxies=False,
            )
            fix_segment(builder, edge=first)
        model = builder.finalize(device="cpu")
        solver = DiSMechSolver(model, theta=0.5, iterations=1, exact=True, self_contact=False)
        return Rods(solver, [model.state(), model.state()])

    def _tip(self, rods: Rods) -> FloatArray:
        tip: FloatArray = rods.states[0].particle_q.numpy()[self.elements + 1][[0, 2]].astype(np.float64)
        return tip

    def accuracy(self) -> task.Accuracy:
        """Errors of one rod."""
        rods = self.build(1)
        # Backward Euler comes to rest.
        rods.solver.theta = 1.0
        for _ in range(400):
            rods.step(0.0, 0.02)
        rods.solver.theta = 0.5
        for state in rods.states:
            state.dismech.qd.zero_()
        at_rest, tips = self._tip(rods), []
        for frame in range(task.FRAMES):
            rods.step_frame(frame, self.substeps)
            tips.append(self._tip(rods))
        return task.accuracy(at_rest, np.array(tips), self.damping)

    def seconds(self) -> float:
        """CPU seconds per frame for all rods in one solver."""
        rods = self.build(task.RODS)
        rods.step_frame(0, self.substeps)
        frames = 5
        start = time.process_time()
        for frame in range(frames):
            rods.step_frame(frame + 1, self.substeps)
        return (time.process_time() - start) / frames
