"""Runs hairbake as a user would: writes a scene, calls the program, and reads the cache with Pixar's USD."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hairbake.rods import Motion, Scene, bake_scene
from hairbake_validate.cache import CLAMPS, GUIDES, Cache, read_frame

from .arrays import FloatArray


@dataclass(frozen=True)
class Hairbake:
    """The program."""

    binary: Path

    def bake(self, scene: Scene, origin: Sequence[float] | FloatArray = (0.0, 0.0, 0.0)) -> Motion:
        """Bakes `scene`; positions are relative to `origin`."""
        with tempfile.TemporaryDirectory() as folder:
            return read_bake(self.bake_into(Path(folder), scene, origin))

    def bake_into(
        self, folder: Path, scene: Scene, origin: Sequence[float] | FloatArray = (0.0, 0.0, 0.0)
    ) -> Path:
        """Writes the scene into `folder`, bakes it, and returns the folder of the cache.

        Raises:
            HairbakeError: hairbake reports an error.
        """
        return bake_scene(scene, folder, origin, self.binary)

    def tips(self, scene: Scene, frame: int = -1) -> FloatArray:
        """Tips of all strands at one frame, `strands × 3`, m, at the precision of the solver.

        The cache's 32-bit numbers have seven digits. A second bake moves every strand so that its tip is near
        the origin of the world, where they resolve 1e-14 m. Only for a clamp that stands still.
        """
        near = np.array([points[frame, -1] for points in self.bake(scene).points])
        moved = [
            replace(strand, points=strand.points - tip)
            for strand, tip in zip(scene.strands, near, strict=True)
        ]
        again = self.bake(replace(scene, strands=moved))
        tips: FloatArray = near + np.array([points[frame, -1] for points in again.points])
        return tips

    def tip(self, scene: Scene, frame: int = -1) -> FloatArray:
        """Tip of the first strand at one frame, m, at the precision of the solver, on any clamp."""
        near = self.bake(scene).points[0][frame, -1]
        tip: FloatArray = near + self.bake(scene, near).points[0][frame, -1]
        return tip


def read_bake(out: Path) -> Motion:
    """Reads the guides of a cache with Pixar's USD."""
    cache = Cache(out)
    counts = next(curves.counts for curves in cache.curves if curves.path == GUIDES)
    frames = [read_frame(cache, frame).values for frame in cache.frames]

    def split(name: str) -> list[FloatArray]:
        values = np.array([frame[f"{GUIDES}.{name}"] for frame in frames], dtype=float)
        return np.split(values * cache.metres_per_unit, np.cumsum(counts)[:-1], axis=1)

    figures = [frame["figures"] for frame in cache.record["frames"]]
    clamp = f"{GUIDES}.{CLAMPS[0]}"
    forces = np.array([frame[clamp] for frame in frames], dtype=float) if clamp in frames[0] else None
    return Motion(np.array(cache.frames) / cache.fps, split("points"), split("velocities"), figures, forces)
