"""hairbake, run as a program on scene files."""

import json
import os
import subprocess
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from physics import motion
from physics.reference import planar
from physics.scene import HORIZONTAL, Hairbake, Rod, Scene, Strand
from physics.study import AT_REST

from . import task


@dataclass(frozen=True)
class HairbakeRods:
    """hairbake at some number of nodes and sub-steps a frame."""

    binary: Path
    elements: int
    """Elements between strain nodes."""
    substeps: int
    name = "hairbake"
    clamp = "exact"
    damping = task.DAMPING

    def scene(self, rods: int, frames: int) -> Scene:
        """Naturally straight rods, drawn as they sag."""
        rod = Rod(damping=task.DAMPING, length=task.LENGTH, natural=(0.0, 0.0, 0.0)).weighing(task.GAMMA)
        drawn = planar.equilibrium(task.GAMMA).at(np.linspace(0, 1, 65))[4:] * task.LENGTH
        strand = Strand(rod, np.vstack([drawn, np.zeros(65)]).T, HORIZONTAL)
        return Scene(
            [strand] * rods,
            nodes=self.elements + 1,
            fps=task.FPS,
            substeps=self.substeps,
            frames=frames,
            motion=motion.shaken,
            settings={"scheme": "bdf2"},
        )

    def accuracy(self) -> task.Accuracy:
        """Errors of one rod."""
        program = Hairbake(self.binary)
        scene = self.scene(1, task.FRAMES)
        still = replace(scene, motion=None, **AT_REST)
        tips = program.bake(scene).points[0][1 : task.FRAMES + 1, -1, :2]
        tips = tips - [[motion.shake(t / task.FPS)[0], 0.0] for t in range(1, task.FRAMES + 1)]
        return task.accuracy(program.tips(still)[0, :2], tips, self.damping)

    def seconds(self) -> float:
        """CPU seconds a frame for all rods on one thread: a bake of the whole second less one of a frame, so that start-up falls
        out; the writing of the cache stays in.
        """
        return (self._cpu(task.FRAMES) - self._cpu(2)) / (task.FRAMES - 2)

    def _cpu(self, frames: int) -> float:
        scene = self.scene(task.RODS, frames)
        with tempfile.TemporaryDirectory() as folder:
            groom, anim = Path(folder, "groom.json"), Path(folder, "anim.json")
            groom.write_text(json.dumps(scene.groom()))
            anim.write_text(json.dumps(scene.anim(np.zeros(3))))
            command = [self.binary, "--quiet", "--threads", "1", groom, anim, "-o", Path(folder, "out")]
            child = subprocess.Popen([str(c) for c in command])
            _, status, usage = os.wait4(child.pid, 0)
            if status:
                raise RuntimeError("hairbake failed")
            return usage.ru_utime + usage.ru_stime
