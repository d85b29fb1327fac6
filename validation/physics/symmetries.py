"""Symmetries of mechanics: rigid motions of the world, and uniform motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from hairbake.rods import IDENTITY, Pose, Rod, Scene, Strand, quaternion

from .arrays import FloatArray
from .program import Hairbake
from .study import SCHEMES, Study, absolute


@dataclass(frozen=True)
class RigidMotion:
    """A rotation and translation of the whole world."""

    turn: Rotation
    shift: FloatArray

    def points(self, points: FloatArray) -> FloatArray:
        """Points moved with the world."""
        return self.turn.apply(points) + self.shift

    def scene(self, scene: Scene) -> Scene:
        """The scene moved with the world: strands, gravity, wind and motion of the clamp.

        Strands are only turned: they are placed relative to the clamp.
        """
        clamp = scene.motion
        assert clamp is not None

        def motion(t: float) -> Pose:
            place, (w, x, y, z) = clamp(t)
            q = (self.turn * Rotation.from_quat([x, y, z, w]) * self.turn.inv()).as_quat()
            return self.points(place), np.array([q[3], q[0], q[1], q[2]])

        return replace(
            scene,
            strands=[self._strand(strand) for strand in scene.strands],
            gravity=self._vector(scene.gravity),
            wind=None if scene.wind is None else self._vector(scene.wind),
            motion=motion,
        )

    def _strand(self, strand: Strand) -> Strand:
        w, x, y, z = strand.frame
        frame = quaternion((self.turn * Rotation.from_quat([x, y, z, w])).as_matrix())
        return replace(strand, points=self.turn.apply(strand.points), frame=frame)

    def _vector(self, vector: Sequence[float]) -> tuple[float, float, float]:
        x, y, z = self.turn.apply(vector)
        return (x, y, z)


MOTIONS = {
    "quarter turn": RigidMotion(Rotation.from_rotvec([0, 0, np.pi / 2]), np.zeros(3)),
    "slanted turn and shift of 3 m": RigidMotion(
        Rotation.from_rotvec([0.7, -1.9, 0.4]), np.array([1.0, 2, -2])
    ),
}


def swung(t: float) -> Pose:
    """A clamp that is shaken along x and turns about a slanted axis."""
    q = Rotation.from_rotvec(0.8 * np.sin(2 * np.pi * 1.5 * t) * np.array([0.6, 0.64, 0.48])).as_quat()
    return np.array([0.05 * np.sin(2 * np.pi * 2.5 * t), 0.02 * np.sin(9 * t), 0.0]), np.array([q[3], *q[:3]])


def bent_strand() -> Strand:
    """A bent elliptic strand, damped, with drag."""
    s = np.linspace(0, 1, 24)
    points = np.stack([0.2 * s, -0.1 * s**2, 0.03 * np.sin(np.linspace(0, 3, 24))], axis=1)
    tangent = CubicSpline(s, points)(0.0, 1)
    d3 = tangent / np.linalg.norm(tangent)
    d1 = np.cross([0.0, 1, 0], d3)
    d1 /= np.linalg.norm(d1)
    frame = quaternion(np.column_stack([d1, np.cross(d3, d1), d3]))
    rod = Rod(damping=0.005, drag=0.3, bending=(7.8e-9, 1.2e-8))
    return Strand(rod, points, frame)


def study(hairbake: Hairbake, schemes: Sequence[str] = SCHEMES) -> Study:
    """Equivariance under rigid motions, and invariance under uniform motion."""
    strand = bent_strand()
    rows = []
    for scheme in schemes:
        scene = Scene(
            [strand],
            frames=24,
            fps=24.0,
            wind=(0.7, 0.1, -0.3),
            motion=swung,
            settings={"scheme": scheme},
        )
        tip = hairbake.tip(scene)
        for name, motion in MOTIONS.items():
            moved = hairbake.tip(motion.scene(scene))
            error = float(np.linalg.norm(motion.points(tip) - moved) / strand.rod.length)
            rows.append(absolute(f"equivariance, {name}, {scheme}: tip, in L", error, 1e-9))
        name = f"clamp at 3 m/s, no gravity, {scheme}: tip moved, in L"
        rows.append(absolute(name, uniform_motion(hairbake, scheme), 1e-9))
    text = """<p>A bent elliptic strand, damped, on a clamp that is shaken and turned, in wind and weight,
for a second; then the same world turned and shifted: the tip must turn and shift with it. And a clamp at
constant velocity without weight or air: the strand must keep its drawn shape. Tips are read to 1e-14 m by
a second bake with the tip at the origin of the world.</p>"""
    return Study("Symmetries", text, rows)


def uniform_motion(hairbake: Hairbake, scheme: str) -> float:
    """Displacement of a strand's tip relative to its clamp after a second at 3 m/s, in L."""
    velocity = np.array([1.0, 2.0, -2.0])
    rod = Rod()
    s = np.linspace(0, 1, 24)
    bent = np.stack([0.2 * s, -0.1 * s**2, 0.03 * np.sin(3 * s)], axis=1)
    scene = Scene(
        [Strand(rod, bent)],
        frames=24,
        fps=24.0,
        gravity=(0.0, 0.0, 0.0),
        motion=lambda t: (velocity * t, IDENTITY),
        settings={"scheme": scheme},
    )
    end = hairbake.tip(scene) - velocity * (hairbake.bake(scene).times[-1])
    start = hairbake.tip(replace(scene, motion=lambda _: (np.zeros(3), IDENTITY)), frame=0)
    return float(np.linalg.norm(end - start) / rod.length)
