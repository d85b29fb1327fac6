"""Studies of single rods: scenes of a few strands, and their motion.

SI units, Y up, world space. The groom is a few single strands, each with its own material, on one clamp
(hairbake's "head") that stands still or follows a motion.
"""

import json
import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cache import Cache
from .program import run

FloatArray = NDArray[np.floating[Any]]

GRAVITY = 9.81
"""Acceleration of gravity in all studies, m/s²."""

ISOLATED_DRAG = 2.07e-4
"""Drag of an isolated hair across flow, per length and speed, N·s/m² (docs/theory.md §4.2); half along."""

Pose = tuple[FloatArray, FloatArray]
"""Position, m, and unit quaternion (w, x, y, z)."""
Track = Callable[[float], Pose]
"""Pose of a body at a time, s."""
Collider = dict[str, Any]
"""A collider as it appears in anim.json."""
Quaternion = tuple[float, float, float, float]
"""Unit quaternion (w, x, y, z)."""


@dataclass(frozen=True)
class Rod:
    """Length, stiffnesses and material of a strand."""

    length: float = 0.25
    """m"""
    bending: tuple[float, float] = (7.8e-9, 7.8e-9)
    """EI1, EI2 about the two section axes, N·m²."""
    torsion: float = 3.6e-9
    """GJ, N·m²."""
    line_density: float = 6.6e-6
    """ρS, kg/m."""
    damping: float = 0.0
    """Kelvin-Voigt time, s."""
    drag: float = 0.0
    """Factor on the drag of an isolated hair."""
    natural: tuple[float, float, float] | None = None
    """Natural strain (κ1, κ2, τ), 1/m; None: that of the drawn shape."""
    friction: float = 0.3
    """Coulomb friction coefficient."""
    friction_parallel: float = 0.5
    """Friction along parallel strands relative to that of crossing ones."""
    cohesion: float = 0.0
    """Force per length between parallel strands that touch, N/m."""
    radius: float = 4e-5
    """Semi-axis of the section along d1, m; the moduli follow from it. Strands keep a distance that grows
    with it."""

    def with_weight(self, gamma: float) -> "Rod":
        """The same rod with the density that gives Γ = ρSgL³/EI1."""
        return replace(self, line_density=gamma * self.bending[0] / (GRAVITY * self.length**3))

    def material(self, name: str) -> dict[str, Any]:
        """The material in groom.json: an elliptic section and moduli that give these stiffnesses."""
        ei1, ei2 = self.bending
        # EI1 / EI2 = (a2 / a1)²; the size of the section is free.
        a1 = self.radius
        a2 = a1 * math.sqrt(ei1 / ei2)
        polar = math.pi * (a1 * a2) ** 3 / (a1**2 + a2**2)
        entry = {
            "name": name,
            "young_modulus_pa": ei2 / (math.pi / 4 * a1**3 * a2),
            "shear_modulus_pa": self.torsion / polar,
            "density_kg_m3": self.line_density / (math.pi * a1 * a2),
            "section": {"semi_axes_m": [a1, a2]},
            "sag_free": 0.0,
            "damping_s": self.damping,
            "drag": self.drag,
            "shielding": 0.0,
            "friction": self.friction,
            "friction_parallel": self.friction_parallel,
            "cohesion_n_m": self.cohesion,
        }
        if self.natural is not None:
            entry["natural_curvature_per_m"] = list(self.natural)
        return entry


@dataclass(frozen=True)
class Strand:
    """One strand as drawn, clamped at its first point."""

    rod: Rod
    points: FloatArray
    """Drawn shape, `n × 3`, m, from root to tip; the root's tangent is the direction of the clamp."""
    frame: Quaternion = (1.0, 0.0, 0.0, 0.0)
    """Clamp frame (d1, d2, tangent)."""
    hairs: int = 1
    """Number of hairs that it represents, in scenes with `arc`."""


@dataclass(frozen=True)
class Scene:
    """Strands, loads, motion, and the resolution of the bake."""

    strands: Sequence[Strand]
    frames: int = 1
    """Frames after the one at time 0."""
    fps: float = 24.0
    substeps: int = 8
    preroll: float = 0.0
    """Time simulated before time 0, s."""
    nodes: int | None = None
    """Number of strain nodes, spaced as by default; None: hairbake's default number."""
    arc: Sequence[float] | None = None
    """Strain nodes at these arc-length fractions instead."""
    gravity: tuple[float, float, float] = (0.0, -GRAVITY, 0.0)
    wind: tuple[float, float, float] | None = None
    force: dict[str, Any] | None = None
    """Acceleration over time: {"frames": […], "values": […]}, m/s²."""
    motion: Track | None = None
    """Motion of the clamp; None: it stands still."""
    colliders: Sequence[Collider] = ()
    """Colliders, on the body "floor", which stands still, unless they name another."""
    bodies: dict[str, Track] = field(default_factory=dict)
    """Bodies besides "clamp" and "floor" that carry colliders, by name."""
    roots: Sequence[dict[str, Any]] = ()
    """How roots are held, as in anim.json; strands have their index as id."""
    ties: Sequence[dict[str, Any]] = ()
    """Ties as in anim.json; strands have their index as id."""
    loads: Sequence[dict[str, Any]] = ()
    """Loads as in anim.json."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Further settings, as in anim.json. Unless they say otherwise contact is with bodies alone: strands are
    rods of their own, not hair of one head."""

    def groom(self) -> dict[str, Any]:
        """Content of groom.json."""
        groom: dict[str, Any] = {
            "format": "hairbake-groom",
            "version": 1,
            "materials": [s.rod.material(f"m{i}") for i, s in enumerate(self.strands)],
            "groups": [{"name": f"g{i}", "material": i} for i in range(len(self.strands))],
            "guides": {
                "vertices": [len(s.points) for s in self.strands],
                "points": np.concatenate([s.points for s in self.strands]).tolist(),
                "group": list(range(len(self.strands))),
                "root_frame_wxyz": [list(s.frame) for s in self.strands],
            },
        }
        if self.arc is not None:
            groom["wisps"] = self._wisps(list(self.arc))
        return groom

    def _wisps(self, arc: list[float]) -> dict[str, Any]:
        """One wisp for each strand, with sections at `arc`. It is straight: only the fractions matter."""
        n = len(self.strands)
        centre = [
            (s.points[0] + u * (s.points[-1] - s.points[0])).tolist() for s in self.strands for u in arc
        ]
        return {
            "parent": [-1] * n,
            "length": [s.rod.length for s in self.strands],
            "strand_count": [s.hairs for s in self.strands],
            "sections": [len(arc)] * n,
            "arc": arc * n,
            "centre": centre,
            "frame_wxyz": [list(s.frame) for s in self.strands for _ in arc],
            "radius": [1e-4] * (n * len(arc)),
            "guide_count": [1] * n,
            "guides": list(range(n)),
        }

    def anim(self, origin: FloatArray) -> dict[str, Any]:
        """Content of anim.json, with the point `origin` of the world moved to zero."""
        rods = {"substeps": self.substeps, "preroll_s": self.preroll, "contact": "bodies"}
        settings = {**rods, **self.settings}
        if self.nodes is not None:
            settings["nodes"] = self.nodes
        motions = {"clamp": self.motion, "floor": None, **self.bodies}
        anim: dict[str, Any] = {
            "format": "hairbake-anim",
            "version": 1,
            "fps": self.fps,
            # hairbake adds a handle frame at both ends; frame 0, at time 0, is the first one.
            "frames": [1, max(self.frames - 1, 1)],
            "bodies": [
                {"name": name, "track": self._track(motion, origin)} for name, motion in motions.items()
            ],
            "colliders": [{"body": "floor", **collider} for collider in self.colliders],
            "gravity_m_s2": list(self.gravity),
            "settings": settings,
        }
        if self.roots:
            anim["roots"] = list(self.roots)
        if self.ties:
            anim["ties"] = list(self.ties)
        if self.loads:
            anim["loads"] = list(self.loads)
        if self.wind is not None:
            anim["wind"] = [{"velocity_m_s": list(self.wind)}]
        if self.force is not None:
            anim["forces"] = [{"acceleration_m_s2": self.force}]
        return anim

    def _track(self, motion: Track | None, origin: FloatArray) -> dict[str, Any]:
        if motion is None:
            return {"translation": [(-origin).tolist()], "rotation_wxyz": [[1.0, 0.0, 0.0, 0.0]]}
        # At this rate the cubic spline through the samples is exact to 1e-9 m for every motion here.
        rate = 1000.0
        start = -self.preroll - 4 / self.fps
        end = (self.frames + 4) / self.fps
        poses = [motion(start + i / rate) for i in range(math.ceil((end - start) * rate) + 1)]
        return {
            "fps": rate,
            "first_frame": start * self.fps,
            "translation": [(p - origin).tolist() for p, _ in poses],
            "rotation_wxyz": [q.tolist() for _, q in poses],
            "smoothing_hz": 0.0,
            "pops": "keep",
        }


def straight(rod: Rod, direction: Sequence[float], root: Sequence[float] = (0.0, 0.0, 0.0)) -> FloatArray:
    """Points of a straight strand from `root` along `direction`, `9 × 3`, m."""
    points: FloatArray = np.linspace(0.0, rod.length, 9)[:, None] * np.asarray(direction, float)
    points += np.asarray(root, float)
    return points


def quaternion(columns: FloatArray) -> Quaternion:
    """The rotation matrix with these columns as a quaternion."""
    # Of the four equations for the components that with the largest one is accurate.
    m = np.asarray(columns, float)
    trace, (xx, yy, zz) = np.trace(m), np.diag(m)
    squares = np.array([1 + trace, 1 + 2 * xx - trace, 1 + 2 * yy - trace, 1 + 2 * zz - trace])
    skew = [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]
    products = np.array(
        [
            [squares[0], *skew],
            [skew[0], squares[1], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [skew[1], m[0, 1] + m[1, 0], squares[2], m[1, 2] + m[2, 1]],
            [skew[2], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[3]],
        ]
    )
    w, x, y, z = products[squares.argmax()] / (2 * math.sqrt(squares.max()))
    return (float(w), float(x), float(y), float(z))


IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
"""The rotation of a body that does not turn, as a quaternion."""
HORIZONTAL = quaternion(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]))
"""Clamp along x, its first section axis along −z and its second up: weight bends about d1."""
EDGE_ON = quaternion(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]))
"""Clamp along x, its first section axis up: weight bends about d2."""
DOWN = quaternion(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
"""Clamp straight down, its first section axis along x: a natural curvature about d2 bends towards x."""
ALONG_Z = (1.0, 0.0, 0.0, 0.0)
"""Clamp along z, its section axes along x and y."""


@dataclass(frozen=True)
class Motion:
    """Strands over time, from frame 0, at time 0, on."""

    times: FloatArray
    """Times of the frames, s."""
    points: list[FloatArray]
    """Points of each strand, `frames × points × 3`, m, at the precision of the cache's 32-bit numbers."""
    velocities: list[FloatArray]
    """Velocities of each strand, `frames × points × 3`, m/s."""
    figures: list[dict[str, Any]]
    """hairbake's own figures of each frame."""
    clamp_forces: FloatArray | None = None
    """Force of the clamp on each strand, `frames × strands × 3`, N; with the setting `reactions`."""
    clamp_moments: FloatArray | None = None
    """Moment of the clamp on each strand about its root, `frames × strands × 3`, N·m."""
    tie_forces: FloatArray | None = None
    """Force of each tie on a strand, `frames × ties × 3`, N, strand after strand."""
    tie_moments: FloatArray | None = None
    """Moment of each tie on a strand about the place that it holds, shaped as `tie_forces`, N·m."""

    @classmethod
    def read(cls, cache: Cache) -> "Motion":
        """The guides of a cache."""
        guides, scale = cache.guides, cache.metres_per_unit
        arrays = cache.description["arrays"]

        def reactions(name: str) -> FloatArray | None:
            return cache.moving(f"guides.{name}", None) if f"guides.{name}" in arrays else None

        return cls(
            times=np.array(cache.frames) / cache.fps,
            points=guides.split(guides.points() * scale),
            velocities=guides.split(guides.velocities() * scale),
            figures=[dict(frame["figures"]) for frame in cache.record["frames"]],
            clamp_forces=reactions("clamp_forces"),
            clamp_moments=reactions("clamp_moments"),
            tie_forces=reactions("tie_forces"),
            tie_moments=reactions("tie_moments"),
        )


def simulate(scene: Scene) -> Motion:
    """Simulates `scene`.

    Raises:
        HairbakeError: hairbake reports an error.
    """
    with tempfile.TemporaryDirectory() as folder:
        return Motion.read(Cache(bake_scene(scene, Path(folder))))


def bake_scene(
    scene: Scene,
    folder: Path,
    origin: Sequence[float] | FloatArray = (0.0, 0.0, 0.0),
    program: Path | None = None,
) -> Path:
    """Writes `scene` into `folder`, bakes it there, and returns the folder of the cache.

    Args:
        scene: The strands, loads, motion and resolution.
        folder: An empty folder.
        origin: Point to which positions in the cache are relative, m: near it its 32-bit numbers are exact.
        program: The program; by default that of [`hairbake.find_program`].

    Raises:
        HairbakeError: hairbake reports an error.
    """
    groom, anim, out = folder / "groom.json", folder / "anim.json", folder / "cache"
    groom.write_text(json.dumps(scene.groom()))
    anim.write_text(json.dumps(scene.anim(np.asarray(origin, float))))
    run("--quiet", "--no-pictures", groom, anim, "-o", out, program=program)
    return out
