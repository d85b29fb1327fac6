"""MuJoCo: a chain of rigid segments with ball joints between them."""

import time
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from physics.arrays import FloatArray

from . import task

RADIUS = 0.005
"""Radius of the segments, m; it enters their rotary inertia only."""


@dataclass(frozen=True)
class MujocoRods:
    """A chain of about `elements` joints.

    Own clamp: the first segment is welded to the clamp, as in MuJoCo's composite cable. Consistent clamp:
    that segment has half the length, so that each joint is in the middle of the length it represents.
    """

    elements: int
    substeps: int
    consistent: bool
    name = "MuJoCo"
    damping = task.DAMPING

    @property
    def clamp(self) -> str:
        """Kind of clamp."""
        return "consistent" if self.consistent else "own"

    @cached_property
    def lengths(self) -> list[float]:
        """Length of each segment, m."""
        length = task.LENGTH / self.elements
        if self.consistent:
            return [length / 2] + [length] * (self.elements - 1) + [length / 2]
        return [length] * self.elements

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The model of one chain."""
        stiffness = task.BENDING * self.elements / task.LENGTH
        chain = ""
        for i, length in enumerate(self.lengths):
            mass = task.LINE_DENSITY * length
            across = mass * (length * length / 12 + RADIUS**2 / 4)
            place = self.lengths[i - 1] if i else 0.0
            joint = f'<joint type="ball" stiffness="{stiffness}" damping="{stiffness * task.DAMPING}"/>'
            inertia = f'diaginertia="{mass * RADIUS**2 / 2} {across} {across}"'
            chain += f"""<body pos="{place} 0 0">{joint if i else ""}
                <inertial pos="{length / 2} 0 0" mass="{mass}" {inertia}/>"""
        # Contacts and constraints are off: only the equations of the rod are solved.
        return mujoco.MjModel.from_xml_string(f"""<mujoco>
            <option timestep="{1 / (task.FPS * self.substeps)}" integrator="implicitfast">
              <flag contact="disable" constraint="disable" sensor="disable"/></option>
            <worldbody>{chain}{"</body>" * len(self.lengths)}</worldbody></mujoco>""")

    def settled(self) -> mujoco.MjData:
        """A chain at rest under its weight."""
        model, data = self.model, mujoco.MjData(self.model)
        # First with strong damping, which is implicit, then with its own.
        own = model.dof_damping.copy()
        for damping, seconds in ((20 * own, 8.0), (own, 4.0)):
            model.dof_damping[:] = damping
            self._set_gravity(0.0)
            for _ in range(round(seconds * task.FPS * self.substeps)):
                mujoco.mj_step(model, data)
        return data

    def _set_gravity(self, t: float) -> None:
        x, y = task.gravity(t)
        self.model.opt.gravity[:] = (x, 0.0, y)

    def _tip(self, data: mujoco.MjData) -> FloatArray:
        mujoco.mj_kinematics(self.model, data)
        along = data.xmat[-1].reshape(3, 3)[:, 0]
        tip: FloatArray = (data.xpos[-1] + along * self.lengths[-1])[[0, 2]]
        return tip

    def accuracy(self) -> task.Accuracy:
        """Errors of one rod."""
        data = self.settled()
        at_rest, tips = self._tip(data), []
        for frame in range(task.FRAMES):
            self._step_frame(frame, [data])
            tips.append(self._tip(data))
        return task.accuracy(at_rest, np.array(tips), self.damping)

    def _step_frame(self, frame: int, rods: list[mujoco.MjData]) -> None:
        for step in range(self.substeps):
            # Gravity at the middle of the step is of second order in it.
            self._set_gravity((frame + (step + 0.5) / self.substeps) / task.FPS)
            for data in rods:
                mujoco.mj_step(self.model, data)

    def seconds(self) -> float:
        """CPU seconds per frame for all rods on one thread, each with its own state of one small model."""
        rods = [mujoco.MjData(self.model) for _ in range(task.RODS)]
        frames = 5
        start = time.process_time()
        for frame in range(frames):
            self._step_frame(frame, rods)
        return (time.process_time() - start) / frames
