"""Runs hairbake as a user would: writes groom.json and anim.json, calls the program, reads the USD cache back.

SI units, Y up, world space. The groom is a handful of single strands, each with a material of its own, on one clamp
(hairbake's "head") that stands still or follows a motion.
"""

import json
import math
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hairbake_validate.cache import GUIDES, Cache, read_frame

GRAVITY = 9.81
"""Size of gravity in all studies, m/s²."""

ISOLATED_DRAG = 2.07e-4
"""Drag per length and speed of an isolated hair across the flow, N·s/m² (docs/theory.md §4.2); half of it along."""

Motion = Callable[[float], tuple[np.ndarray, np.ndarray]]
"""Position, m, and unit quaternion (w, x, y, z) of the clamp at a time, s."""


@dataclass(frozen=True)
class Rod:
    """What a strand is made of, as a rod."""

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
    """Natural strain (κ1, κ2, τ), 1/m; None: the drawn shape."""
    friction: float = 0.3
    """Coulomb friction coefficient."""

    def weighing(self, gamma: float) -> "Rod":
        """The same rod with the density that gives Γ = ρSgL³/EI1."""
        return replace(self, line_density=gamma * self.bending[0] / (GRAVITY * self.length**3))

    def material(self, name: str) -> dict:
        """The entry in groom.json: an elliptic section and moduli that give these stiffnesses."""
        ei1, ei2 = self.bending
        # EI1 / EI2 = (a2 / a1)²; the size of the section is free.
        a1 = 4e-5
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
        }
        if self.natural is not None:
            entry["natural_curvature_per_m"] = list(self.natural)
        return entry


@dataclass(frozen=True)
class Strand:
    """One strand as drawn, clamped at its first point."""

    rod: Rod
    points: np.ndarray
    """Drawn shape, `n × 3`, m, the root first; the root's tangent is the clamp's direction."""
    frame: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """Clamp frame (d1, d2, tangent) as a unit quaternion (w, x, y, z)."""


@dataclass(frozen=True)
class Scene:
    """Strands, what drives them, and how finely hairbake is asked to step."""

    strands: Sequence[Strand]
    frames: int = 1
    """Frames after the one at time 0."""
    fps: float = 24.0
    substeps: int = 8
    preroll: float = 0.0
    """Time simulated before time 0, s."""
    nodes: int | None = None
    """Strain nodes, spaced as hairbake's default; None: hairbake's default number."""
    arc: Sequence[float] | None = None
    """Strain nodes at these arc-length fractions instead."""
    gravity: tuple[float, float, float] = (0.0, -GRAVITY, 0.0)
    wind: tuple[float, float, float] | None = None
    force: dict | None = None
    """Acceleration over time: {"frames": […], "values": […]}, m/s²."""
    motion: Motion | None = None
    colliders: Sequence[dict] = ()
    """What the strands touch, as it stands in anim.json; on the body "floor", which stands still, unless it names another."""
    bodies: dict[str, Motion] = field(default_factory=dict)
    """Bodies beside "clamp" and "floor" that carry colliders, by name."""
    settings: dict = field(default_factory=dict)
    """Further settings, as they stand in anim.json."""

    def groom(self) -> dict:
        """groom.json."""
        groom = {
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

    def _wisps(self, arc: list[float]) -> dict:
        """One wisp for each strand, with sections at `arc`, straight from root to tip: only the fractions matter."""
        n = len(self.strands)
        centre = [
            (s.points[0] + u * (s.points[-1] - s.points[0])).tolist() for s in self.strands for u in arc
        ]
        return {
            "parent": [-1] * n,
            "length": [s.rod.length for s in self.strands],
            "strand_count": [1] * n,
            "sections": [len(arc)] * n,
            "arc": arc * n,
            "centre": centre,
            "frame_wxyz": [list(s.frame) for s in self.strands for _ in arc],
            "radius": [1e-4] * (n * len(arc)),
            "guide_count": [1] * n,
            "guides": list(range(n)),
        }

    def anim(self, origin: np.ndarray) -> dict:
        """anim.json, with the point `origin` of the world moved to zero."""
        settings = {"substeps": self.substeps, "preroll_s": self.preroll, **self.settings}
        if self.nodes is not None:
            settings["nodes"] = self.nodes
        anim = {
            "format": "hairbake-anim",
            "version": 1,
            "fps": self.fps,
            # hairbake adds a handle frame at both ends; frame 0, at time 0, is the first handle.
            "frames": [1, max(self.frames - 1, 1)],
            "bodies": [
                {"name": "clamp", "track": self._track(self.motion, origin)},
                {"name": "floor", "track": still(origin)},
                *(
                    {"name": name, "track": self._track(motion, origin)}
                    for name, motion in self.bodies.items()
                ),
            ],
            "colliders": [{"body": "floor", **collider} for collider in self.colliders],
            "gravity_m_s2": list(self.gravity),
            "settings": settings,
        }
        if self.wind is not None:
            anim["wind"] = [{"velocity_m_s": list(self.wind)}]
        if self.force is not None:
            anim["forces"] = [{"acceleration_m_s2": self.force}]
        return anim

    def _track(self, motion: Motion | None, origin: np.ndarray) -> dict:
        if motion is None:
            return still(origin)
        # Often enough for the cubic spline between them to be exact to 1e-9 m in any motion here.
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


def still(origin: np.ndarray) -> dict:
    """The track of a body that stands where it was drawn."""
    return {"translation": [(-origin).tolist()], "rotation_wxyz": [[1.0, 0.0, 0.0, 0.0]]}


@dataclass(frozen=True)
class Bake:
    """What hairbake wrote: from frame 0, at time 0, on."""

    times: np.ndarray
    """Of the frames, s."""
    points: list[np.ndarray]
    """Of each strand, `frames × points × 3`, m, as precise as the cache's 32-bit numbers."""
    velocities: list[np.ndarray]
    """The same for velocities, m/s."""
    figures: list[dict]
    """hairbake's own figures of each frame."""

    @property
    def unconverged(self) -> int:
        """Solves that hairbake itself reports as not converged."""
        return sum(len(f["unconverged"]) for f in self.figures)


@dataclass(frozen=True)
class Hairbake:
    """The program."""

    binary: Path

    def bake(self, scene: Scene, origin: Sequence[float] = (0.0, 0.0, 0.0)) -> Bake:
        """Bakes `scene`; positions are relative to `origin`."""
        with tempfile.TemporaryDirectory() as folder:
            out = self.bake_into(Path(folder), scene, origin)
            return read(out)

    def bake_into(self, folder: Path, scene: Scene, origin: Sequence[float] = (0.0, 0.0, 0.0)) -> Path:
        """Writes the scene into `folder` and bakes it; the cache's folder."""
        groom, anim, out = folder / "groom.json", folder / "anim.json", folder / "cache"
        groom.write_text(json.dumps(scene.groom()))
        anim.write_text(json.dumps(scene.anim(np.asarray(origin, float))))
        command = [self.binary, "--quiet", groom, anim, "-o", out]
        run = subprocess.run([str(c) for c in command], capture_output=True, text=True)
        if run.returncode:
            raise RuntimeError(f"hairbake ended with {run.returncode}:\n{run.stderr}")
        return out

    def tips(self, scene: Scene, frame: int = -1) -> np.ndarray:
        """Tips of all strands at one frame, `strands × 3`, m, to the precision of the solver. The cache's 32-bit numbers have
        seven digits of whatever they hold, so a second bake moves every strand so that its tip lies near the
        origin of the world, where they resolve 1e-14 m. For a clamp that stands still.
        """
        near = np.array([p[frame, -1] for p in self.bake(scene).points])
        moved = [replace(s, points=s.points - tip) for s, tip in zip(scene.strands, near)]
        return near + [p[frame, -1] for p in self.bake(replace(scene, strands=moved)).points]

    def tip(self, scene: Scene, frame: int = -1) -> np.ndarray:
        """The same for the first strand on a clamp in motion."""
        near = self.bake(scene).points[0][frame, -1]
        return near + self.bake(scene, near).points[0][frame, -1]


def read(out: Path) -> Bake:
    """Reads a cache's guides back with Pixar's USD."""
    cache = Cache(out)
    counts = next(c.counts for c in cache.curves if c.path == GUIDES)
    frames = [read_frame(cache, frame).values for frame in cache.frames]

    def split(name: str) -> list[np.ndarray]:
        whole = np.array([values[f"{GUIDES}.{name}"] for values in frames], dtype=float)
        return np.split(whole * cache.metres_per_unit, np.cumsum(counts)[:-1], axis=1)

    figures = [frame["figures"] for frame in cache.record["frames"]]
    return Bake(np.array(cache.frames) / cache.fps, split("points"), split("velocities"), figures)


def straight(rod: Rod, direction: Sequence[float], root: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """A straight strand."""
    return np.linspace(0.0, rod.length, 9)[:, None] * np.asarray(direction, float) + np.asarray(root, float)


def quaternion(columns: np.ndarray) -> tuple[float, float, float, float]:
    """The unit quaternion (w, x, y, z) of the rotation matrix with these columns."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(columns).as_quat()
    return (float(w), float(x), float(y), float(z))


HORIZONTAL = quaternion(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]))
"""Clamp along x, its first section axis pointing to −z and its second up: weight bends about d1."""
