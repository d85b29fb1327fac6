"""MuJoCo: a chain of rigid segments with ball joints between them."""

import time
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from . import task

RADIUS = 0.005
"""Of the segments, m; enters their rotary inertia alone."""


@dataclass(frozen=True)
class MujocoRods:
    """A chain of `elements` joints or so. Own clamp: the first segment is welded to the clamp, as MuJoCo's composite cable does.
    Consistent: that segment is half as long, so that the joints lie in the middle of what they stand for.
    """

    elements: int
    substeps: int
    consistent: bool
    name = "MuJoCo"
    damping = task.DAMPING

    @property
    def clamp(self) -> str:
        return "consistent" if self.consistent else "own"

    @cached_property
    def lengths(self) -> list[float]:
        l = task.LENGTH / self.elements
        return [l / 2] + [l] * (self.elements - 1) + [l / 2] if self.consistent else [l] * self.elements

    @cached_property
    def model(self) -> mujoco.MjModel:
        stiffness = task.BENDING * self.elements / task.LENGTH
        chain = ""
        for i, l in enumerate(self.lengths):
            mass = task.LINE_DENSITY * l
            across = mass * (l * l / 12 + RADIUS**2 / 4)
            place = self.lengths[i - 1] if i else 0.0
            joint = (
                f'<joint type="ball" stiffness="{stiffness}" damping="{stiffness * task.DAMPING}"/>'
                if i
                else ""
            )
            chain += f"""<body pos="{place} 0 0">{joint}
                <inertial pos="{l / 2} 0 0" mass="{mass}" diaginertia="{mass * RADIUS**2 / 2} {across} {across}"/>"""
        # Nothing but the rod's own equations: neither contacts nor constraints are looked for.
        return mujoco.MjModel.from_xml_string(f"""<mujoco>
            <option timestep="{1 / (task.FPS * self.substeps)}" integrator="implicitfast">
              <flag contact="disable" constraint="disable" sensor="disable"/></option>
            <worldbody>{chain}{"</body>" * len(self.lengths)}</worldbody></mujoco>""")

    def settled(self) -> mujoco.MjData:
        """A chain at rest under its weight."""
        model, data = self.model, mujoco.MjData(self.model)
        # With much damping, that is implicit, and then with its own.
        own = model.dof_damping.copy()
        for damping, seconds in ((20 * own, 8.0), (own, 4.0)):
            model.dof_damping[:] = damping
            self._pull(0.0)
            for _ in range(round(seconds * task.FPS * self.substeps)):
                mujoco.mj_step(model, data)
        return data

    def _pull(self, t: float) -> None:
        x, y = task.gravity(t)
        self.model.opt.gravity[:] = (x, 0.0, y)

    def _tip(self, data: mujoco.MjData) -> np.ndarray:
        mujoco.mj_kinematics(self.model, data)
        along = data.xmat[-1].reshape(3, 3)[:, 0]
        return (data.xpos[-1] + along * self.lengths[-1])[[0, 2]]

    def accuracy(self) -> task.Accuracy:
        """Errors of one rod."""
        data = self.settled()
        at_rest, tips = self._tip(data), []
        for frame in range(task.FRAMES):
            self._frame(frame, [data])
            tips.append(self._tip(data))
        return task.accuracy(at_rest, np.array(tips), self.damping)

    def _frame(self, frame: int, rods: list[mujoco.MjData]) -> None:
        for step in range(self.substeps):
            # The middle of the step: of second order in it.
            self._pull((frame + (step + 0.5) / self.substeps) / task.FPS)
            for data in rods:
                mujoco.mj_step(self.model, data)

    def seconds(self) -> float:
        """CPU seconds a frame for all rods on one thread, each with its own state of one small model."""
        rods = [mujoco.MjData(self.model) for _ in range(task.RODS)]
        frames = 5
        start = time.process_time()
        for frame in range(frames):
            self._frame(frame, rods)
        return (time.process_time() - start) / frames
