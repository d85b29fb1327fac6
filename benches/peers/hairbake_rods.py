"""hairbake, run as a program on scene files."""

import json
import os
import subprocess
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hairbake.rods import HORIZONTAL, Rod, Scene, Strand
from physics.program import Hairbake
from physics.reference import planar
from physics.study import AT_REST
from physics.whip import shake, shaken

from . import task


@dataclass(frozen=True)
class HairbakeRods:
    """hairbake with a number of elements and substeps."""

    binary: Path
    elements: int
    """Elements between strain nodes."""
    substeps: int
    name = "hairbake"
    clamp = "exact"
    damping = task.DAMPING

    def scene(self, rods: int, frames: int) -> Scene:
        """Naturally straight rods, drawn in their sagged shape."""
        rod = Rod(damping=task.DAMPING, length=task.LENGTH, natural=(0.0, 0.0, 0.0)).with_weight(task.GAMMA)
        sagged = planar.equilibrium(task.GAMMA).at(np.linspace(0, 1, 65))[4:] * task.LENGTH
        strand = Strand(rod, np.vstack([sagged, np.zeros(65)]).T, HORIZONTAL)
        return Scene(
            [strand] * rods,
            nodes=self.elements + 1,
            fps=task.FPS,
            substeps=self.substeps,
            frames=frames,
            motion=shaken,
            # The rods are alone: the default would take them, all in one place, for a tuft of hair.
            settings={"contact": "bodies"},
        )

    def accuracy(self) -> task.Accuracy:
        """Errors of one rod."""
        program = Hairbake(self.binary)
        scene = self.scene(1, task.FRAMES)
        still = replace(scene, motion=None, **AT_REST)
        clamp = np.array([[shake(t / task.FPS)[0], 0.0] for t in range(1, task.FRAMES + 1)])
        tips = program.bake(scene).points[0][1 : task.FRAMES + 1, -1, :2] - clamp
        return task.accuracy(program.tips(still)[0, :2], tips, self.damping)

    def seconds(self) -> float:
        """CPU seconds per frame for all rods on one thread.

        A bake of the whole second less one of two frames: start-up cancels, writing the cache does not.
        """
        return (self._cpu(task.FRAMES) - self._cpu(2)) / (task.FRAMES - 2)

    def _cpu(self, frames: int) -> float:
        scene = self.scene(task.RODS, frames)
        with tempfile.TemporaryDirectory() as folder:
            groom, anim = Path(folder, "groom.json"), Path(folder, "anim.json")
            groom.write_text(json.dumps(scene.groom()))
            anim.write_text(json.dumps(scene.anim(np.zeros(3))))
            options = ["--quiet", "--no-pictures", "--threads", "1"]
            command = [self.binary, *options, groom, anim, "-o", Path(folder, "out")]
            child = subprocess.Popen([str(part) for part in command])
            _, status, usage = os.wait4(child.pid, 0)
            if status:
                raise RuntimeError(f"hairbake failed with status {status}")
            return usage.ru_utime + usage.ru_stime
