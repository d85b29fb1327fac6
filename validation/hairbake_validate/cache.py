"""Reads a cache: its static values once, and the file of one frame at a time.

Static values come from the composed stage, as an application sees them. Animated values come from each
frame's own file, because composition hides errors: USD interpolates over a missing file without a message.
"""

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom

from .geometry import Array, FloatArray, IntArray, cross, dot, norms

ROOT_LAYER = "hair.usda"
RECORD = "manifest.json"
SHOT_LAYER = "hair.shot.usda"
"""In over mode: the stage of the groom with the motion of the cache over it."""
GROOM = "/groom"
HEAD = "/groom/head"
HAIR = "/groom/hair"
GUIDES = "/groom/guides"
COLLIDERS = "/groom/colliders"
MATERIAL = "/groom/materials/hair"
TRANSFORM = "xformOp:transform"
LEVEL = "primvars:groom_level"
ARRIVED = "primvars:groom_arrived"
GUIDES_PER_STRAND = 3
"""Number of guides that a cache names for each render strand."""
ACCELERATIONS = "accelerations"
NORMALS = "normals"
CLAMPS = ("primvars:groom_clamp_force", "primvars:groom_clamp_moment")
"""What the clamp exerts on each guide."""
HELD = ("primvars:groom_tie_force", "primvars:groom_tie_moment")
"""What each tie exerts on its guide."""
TIES = ("primvars:groom_tie_guide", "primvars:groom_tie_number")
"""What these are of."""


def frame_file_name(stem: str, frame: int) -> str:
    """File name of a frame, as USD resolves the clip template `stem.####.usdc`.

    The number is padded with zeros to four characters including the sign: frame −1 is `hair.-001.usdc`.
    """
    return f"{stem}.{frame:04d}.usdc"


class CacheError(Exception):
    """The folder holds no cache, or a file of the cache cannot be read."""


@dataclass(frozen=True)
class Curves:
    """The static part of a BasisCurves prim with `n` curves and `N` points."""

    path: str
    """Path of the prim."""
    counts: IntArray
    """Number of points of each curve, `n`."""
    rest: FloatArray
    """Points of the rest pose in the space of the groom, f32, `N × 3`, stage units."""
    widths: FloatArray
    """Diameters, f32, `N`, stage units."""
    arc: FloatArray = field(default_factory=lambda: np.empty(0, np.float32))
    """Arc length from the root to each point of a guide, f32, `N`, stage units; empty for strands."""
    loose: IntArray = field(default_factory=lambda: np.empty(0, int))
    """1 for each curve whose root nothing holds, `n`; empty if all are held."""

    @cached_property
    def consistent(self) -> bool:
        """True if counts and rest points agree and are finite, so that points can be told apart by curve."""
        total = int(self.counts.sum())
        return bool(
            len(self.counts)
            and self.counts.min() >= 2
            and self.rest.shape == (total, 3)
            and np.isfinite(self.rest).all()
        )

    @cached_property
    def starts(self) -> IntArray:
        """Index of each curve's root point, `n`."""
        starts: IntArray = np.cumsum(self.counts) - self.counts
        return starts

    @cached_property
    def held(self) -> FloatArray:
        """1 for each curve whose root is held, 0 for a loose one, `n`."""
        held: FloatArray = np.ones(len(self.counts))
        if self.loose.shape == self.counts.shape:
            held[self.loose != 0] = 0
        return held

    @cached_property
    def curve_of_point(self) -> IntArray:
        """Index of each point's curve, `N`."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @cached_property
    def segments(self) -> IntArray:
        """Index of each segment's first point; its second point is the next one."""
        last = np.zeros(len(self.rest), dtype=bool)
        last[self.starts + self.counts - 1] = True
        return np.flatnonzero(~last)

    @cached_property
    def pairs(self) -> IntArray:
        """Index among `segments` of the first of two segments of a curve; a last one is alone.

        Every second point of a guide is one of its rod. Those in between are where a smooth curve would be,
        and may be off along it next to a kink.
        """
        within = self.segments - self.starts[self.curve_of_point[self.segments]]
        return np.flatnonzero(within % 2 == 0)

    @cached_property
    def rods(self) -> FloatArray | None:
        """Length of each pair of segments along the rod of a guide; None without valid arc lengths."""
        if self.arc.shape != (len(self.rest),) or not np.isfinite(self.arc).all():
            return None
        return self.of_pairs(np.diff(self.arc.astype(float))[self.segments])

    def of_pairs(self, lengths: FloatArray) -> FloatArray:
        """Sums of the lengths of segments over pairs."""
        sums: FloatArray = np.add.reduceat(lengths, self.pairs)
        return sums

    @cached_property
    def rest_chords(self) -> FloatArray:
        """Length of each segment's chord at rest."""
        return self.chords(self.rest)

    @cached_property
    def rest_turns(self) -> FloatArray:
        """Angle between the chords at each rest point, rad, `N`; at a curve's ends that of the next point."""
        steps = np.diff(self.rest.astype(float), axis=0)
        turns = np.zeros(len(self.rest))
        # Beside coincident points the angle is 0: of a negative zero it would be π.
        along = dot(steps[:-1], steps[1:]) + 0.0
        turns[1:-1] = np.arctan2(norms(cross(steps[:-1], steps[1:])), along)
        # Between two curves there is no chord.
        ends = self.starts + self.counts - 1
        turns[self.starts], turns[ends] = 0, 0
        turns[self.starts], turns[ends] = turns[self.starts + 1], turns[ends - 1]
        return turns

    def chords(self, points: FloatArray) -> FloatArray:
        """Length of each segment's chord between points, `N × 3`."""
        exact = points.astype(float)
        return norms(exact[1:] - exact[:-1])[self.segments]


@dataclass(frozen=True)
class Mesh:
    """A collider in its own space."""

    path: str
    """Path of the prim."""
    points: FloatArray
    """Vertices, f64, `V × 3`, stage units; at rest if the mesh deforms."""
    triangles: IntArray
    """Vertex indices, `T × 3`."""
    caps: IntArray
    """The same of triangles that close its holes; they are not drawn."""
    deforms: bool
    """True if each frame has its own vertices."""
    is_skin: bool = False
    """True if the roots ride on it."""

    @property
    def solid(self) -> IntArray:
        """All triangles that hair keeps out of."""
        return np.concatenate([self.triangles, self.caps])

    @property
    def consistent(self) -> bool:
        """True if there are triangles, every index has a vertex, and vertices are finite."""
        corners = self.solid
        within = len(self.triangles) and corners.min() >= 0 and corners.max() < len(self.points)
        return bool(within and np.isfinite(self.points).all())


@dataclass(frozen=True)
class Clip:
    """The value clip set of the groom, as its metadata holds it."""

    template: str
    start: float
    end: float
    stride: float
    prim_path: str
    manifest: str


class Cache:
    """An opened cache."""

    def __init__(self, directory: Path) -> None:
        """Opens the cache in `directory`.

        Raises:
            CacheError: the folder holds no cache that can be opened.
        """
        self.directory = directory
        self.record = self._read_record()
        root = directory / ROOT_LAYER
        if not root.is_file():
            raise CacheError(f"{root}: no such file; pass the folder that a bake wrote")
        try:
            self.stage = Usd.Stage.Open(str(root))
        except Tf.ErrorException as error:
            raise CacheError(f"{root}: {error}") from error
        self.first = round(self.stage.GetStartTimeCode())
        self.last = round(self.stage.GetEndTimeCode())
        self.frames = range(self.first - 1, self.last + 2)
        """The frames of the shot and one handle frame at each end."""
        self.fps: float = self.stage.GetTimeCodesPerSecond()
        self.metres_per_unit: float = UsdGeom.GetStageMetersPerUnit(self.stage)
        self.clip = self._read_clip()
        self.declared = self._read_declared()
        """Paths of the attributes in the clip manifest; None if it cannot be read."""
        self.curves = [self._read_curves(path) for path in (HAIR, GUIDES) if self.stage.GetPrimAtPath(path)]
        self.colliders = [self._read_mesh(prim) for prim in self._collider_prims()]

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the bake, from manifest.json; empty if it holds none."""
        settings = self.record.get("settings")
        return settings if isinstance(settings, dict) else {}

    @property
    def has_solver_steps(self) -> bool:
        """True if the cache has a time sample for every step of the solver (`--curves steps`)."""
        return bool(self.settings.get("curves") == "steps")

    def figure(self, frame: int, name: str) -> float:
        """A figure of a frame, from manifest.json; 0 if it holds none."""
        entries = self.record.get("frames")
        for entry in entries if isinstance(entries, list) else []:
            if isinstance(entry, dict) and entry.get("frame") == frame:
                figures = entry.get("figures")
                value = figures.get(name) if isinstance(figures, dict) else None
                return float(value) if isinstance(value, int | float) else 0.0
        return 0.0

    def frame_path(self, frame: int) -> Path:
        """File of one frame."""
        return self.directory / frame_file_name("hair", frame)

    def sample_times(self, frame: int) -> list[float]:
        """Time codes that a frame's file must hold: the frame, and the samples of its shutter interval."""
        samples, shutter = self.settings.get("samples", 1), self.settings.get("shutter", 0)
        if not isinstance(samples, int) or samples < 2 or not isinstance(shutter, int | float):
            return [float(frame)]
        return [frame + shutter * i / (samples - 1) for i in range(samples)]

    def animated(self) -> list[str]:
        """Paths of the attributes that every frame's file must hold."""
        paths = [
            f"{curves.path}.{name}" for curves in self.curves for name in ("points", "velocities", "extent")
        ]
        paths += [f"{path}.{TRANSFORM}" for path in [HEAD, *(mesh.path for mesh in self.colliders)]]
        paths += [
            f"{curves.path}.{name}"
            for curves in self.curves
            for name in (LEVEL, ARRIVED, ACCELERATIONS, NORMALS, *CLAMPS, *HELD)
            if self.stage.GetPrimAtPath(curves.path).GetAttribute(name).IsAuthored()
        ]
        deforming = [mesh.path for mesh in self.colliders if mesh.deforms]
        return paths + [f"{path}.{name}" for path in deforming for name in ("points", "extent")]

    def _read_declared(self) -> set[str] | None:
        if self.clip is None or not (self.directory / self.clip.manifest).is_file():
            return None
        try:
            layer = Sdf.Layer.OpenAsAnonymous(str(self.directory / self.clip.manifest))
        except Tf.ErrorException:
            return None
        return attributes(layer)

    def _read_record(self) -> dict[str, Any]:
        path = self.directory / RECORD
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise CacheError(f"{path}: {error}") from error
        if not isinstance(record, dict):
            raise CacheError(f"{path}: not a JSON object")
        return record

    def _read_clip(self) -> Clip | None:
        clips = Usd.ClipsAPI(self.stage.GetPrimAtPath(GROOM)) if self.stage.GetPrimAtPath(GROOM) else None
        sets = clips.GetClips() if clips else None
        if not sets:
            return None
        values = next(iter(sets.values()))

        def asset(key: str) -> str:
            value = values.get(key, "")
            return str(value.path if isinstance(value, Sdf.AssetPath) else value)

        return Clip(
            template=asset("templateAssetPath"),
            start=values.get("templateStartTime", float("nan")),
            end=values.get("templateEndTime", float("nan")),
            stride=values.get("templateStride", float("nan")),
            prim_path=values.get("primPath", ""),
            manifest=asset("manifestAssetPath"),
        )

    def _read_curves(self, path: str) -> Curves:
        prim = self.stage.GetPrimAtPath(path)
        curves, primvars = UsdGeom.BasisCurves(prim), UsdGeom.PrimvarsAPI(prim)
        arc, loose = primvars.GetPrimvar("groom_arc"), primvars.GetPrimvar("groom_loose")
        return Curves(
            path=path,
            counts=array(curves.GetCurveVertexCountsAttr().Get(), int, 1),
            rest=array(primvars.GetPrimvar("rest").Get(), np.float32, 2),
            widths=array(curves.GetWidthsAttr().Get(), np.float32, 1),
            arc=array(arc.Get() if arc else None, np.float32, 1),
            loose=array(loose.Get() if loose else None, int, 1),
        )

    def _collider_prims(self) -> list[Usd.Prim]:
        parent = self.stage.GetPrimAtPath(COLLIDERS)
        return [prim for prim in parent.GetChildren() if prim.IsA(UsdGeom.Mesh)] if parent else []

    def _read_mesh(self, prim: Usd.Prim) -> Mesh:
        mesh = UsdGeom.Mesh(prim)
        counts = array(mesh.GetFaceVertexCountsAttr().Get(), int, 1)
        indices = array(mesh.GetFaceVertexIndicesAttr().Get(), int, 1)
        primvars = UsdGeom.PrimvarsAPI(prim)
        rest, caps = primvars.GetPrimvar("rest"), primvars.GetPrimvar("groom_caps")
        corners = array(caps.Get() if caps else (), int, 1)
        all_triangles = bool((counts == 3).all()) and len(indices) == 3 * len(counts)
        return Mesh(
            path=str(prim.GetPath()),
            points=array(rest.Get() if rest else mesh.GetPointsAttr().Get(), np.float64, 2),
            deforms=bool(rest),
            is_skin=bool(primvars.GetPrimvar("groom_skin")),
            triangles=indices.reshape(-1, 3) if all_triangles else np.empty((0, 3), int),
            caps=corners[: len(corners) // 3 * 3].reshape(-1, 3),
        )


@dataclass(frozen=True)
class FrameFile:
    """The animated values of one frame, from its own file. Keys are attribute paths."""

    frame: int
    times: dict[str, list[float]] = field(default_factory=dict)
    """Time codes of each attribute's samples."""
    values: dict[str, Array] = field(default_factory=dict)
    """Values at the frame."""
    later: dict[float, dict[str, Array]] = field(default_factory=dict)
    """Values at the time codes after the frame."""


def attribute_value(cache: Cache, path: str, name: str) -> Any:
    """The value of an attribute; an empty tuple if there is none."""
    prim = cache.stage.GetPrimAtPath(path)
    return (prim.GetAttribute(name).Get() if prim and prim.HasAttribute(name) else None) or ()


def read_frame(cache: Cache, frame: int) -> FrameFile:
    """Reads the whole file of one frame.

    Raises:
        CacheError: the file is missing or damaged.
    """
    return read_layer(cache.frame_path(frame), frame)


def read_layer(path: Path, frame: int) -> FrameFile:
    """Reads the whole file of one frame at `path`.

    Raises:
        CacheError: the file is missing or damaged.
    """
    if not path.is_file():
        raise CacheError("no such file")
    file = FrameFile(frame)
    try:
        # An anonymous layer is not cached: its memory is freed when this function returns.
        layer = Sdf.Layer.OpenAsAnonymous(str(path))
        for name in sorted(attributes(layer)):
            file.times[name] = list(layer.ListTimeSamplesForPath(name))
            for time in file.times[name]:
                if time >= frame:
                    values = file.values if time == frame else file.later.setdefault(time, {})
                    values[name] = np.array(layer.QueryTimeSample(name, time))
    except Tf.ErrorException as error:
        raise CacheError(f"damaged: {error.args[0] if error.args else error}") from error
    return file


def read_value(cache: Cache, frame: int, path: str) -> Array | None:
    """Value of an attribute at a frame, from its file; None if there is none, or no readable file."""
    try:
        layer = Sdf.Layer.OpenAsAnonymous(str(cache.frame_path(frame)))
        value = layer.QueryTimeSample(path, float(frame))
    except Tf.ErrorException:
        return None
    return None if value is None else np.array(value)


def attributes(layer: Sdf.Layer) -> set[str]:
    """Paths of all attributes in a layer."""
    paths: set[str] = set()

    def collect(path: Sdf.Path) -> None:
        if path.IsPropertyPath():
            paths.add(str(path))

    layer.Traverse(Sdf.Path.absoluteRootPath, collect)
    return paths


def array(value: Any, dtype: type, dimensions: int) -> Array:
    """A USD array as a numpy array of `dtype`; empty, of shape (0,) or (0, 3), if there is no value."""
    if value is None or len(value) == 0:
        return np.empty((0, 3)[:dimensions], dtype)
    return np.array(value, dtype)
