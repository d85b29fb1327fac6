"""Reads a cache: what does not move once, and one frame's file at a time.

Static values come from the composed stage, as an application sees them. Moving values come from the frame's own file,
because composition hides faults: a missing file is interpolated over, and nothing says so.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom

ROOT_LAYER = "hair.usda"
RECORD = "manifest.json"
GROOM = "/groom"
HEAD = "/groom/head"
HAIR = "/groom/hair"
GUIDES = "/groom/guides"
COLLIDERS = "/groom/colliders"
MATERIAL = "/groom/materials/hair"
TRANSFORM = "xformOp:transform"
LEVEL = "primvars:groom_level"
ACCELERATIONS = "accelerations"


class Unreadable(Exception):
    """The folder is no cache, or one that cannot be opened at all."""


@dataclass(frozen=True)
class Curves:
    """The static part of a BasisCurves prim: `n` curves, `N` points in all."""

    path: str
    counts: np.ndarray
    """Points of each curve, int, `n`."""
    rest: np.ndarray
    """Rest points, f32, `N × 3`, cache units."""
    widths: np.ndarray
    """Diameters, f32, `N`, cache units."""

    @property
    def sound(self) -> bool:
        """Whether the arrays agree, so that points can be told apart by curve."""
        total = int(self.counts.sum())
        return bool(
            len(self.counts)
            and self.counts.min() >= 2
            and self.rest.shape == (total, 3)
            and np.isfinite(self.rest).all()
        )

    @property
    def starts(self) -> np.ndarray:
        """Index of each curve's root point, `n`."""
        return np.cumsum(self.counts) - self.counts

    @property
    def curve_of_point(self) -> np.ndarray:
        """Index of each point's curve, `N`."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @property
    def segments(self) -> np.ndarray:
        """Index of each segment's first point; the second is the next one."""
        last = np.zeros(len(self.rest), dtype=bool)
        last[self.starts + self.counts - 1] = True
        return np.flatnonzero(~last)


@dataclass(frozen=True)
class Mesh:
    """A collider in the rest space of its body."""

    path: str
    points: np.ndarray
    """f64, `V × 3`, cache units; at rest, where the mesh deforms."""
    triangles: np.ndarray
    """Vertex indices, `T × 3`."""
    deforms: bool
    """Whether every frame has points of its own."""

    @property
    def sound(self) -> bool:
        """Whether there are triangles, all of whose vertices exist."""
        within = len(self.triangles) and self.triangles.min() >= 0 and self.triangles.max() < len(self.points)
        return bool(within and np.isfinite(self.points).all())


@dataclass(frozen=True)
class Clip:
    """The value clip set of the groom, as its metadata has it."""

    template: str
    start: float
    end: float
    stride: float
    prim_path: str
    manifest: str


class Cache:
    """An opened cache. Raises `Unreadable` where there is none."""

    def __init__(self, directory: Path):
        self.directory = directory
        self.record = self._read_record()
        root = directory / ROOT_LAYER
        if not root.is_file():
            raise Unreadable(f"{root}: no such file")
        try:
            self.stage = Usd.Stage.Open(str(root))
        except Tf.ErrorException as error:
            raise Unreadable(f"{root}: {error}") from error
        self.first = round(self.stage.GetStartTimeCode())
        self.last = round(self.stage.GetEndTimeCode())
        self.frames = range(self.first - 1, self.last + 2)
        """The shot's frames and a handle at each end."""
        self.fps = self.stage.GetTimeCodesPerSecond()
        self.metres_per_unit = UsdGeom.GetStageMetersPerUnit(self.stage)
        self.clip = self._read_clip()
        self.declared = self._read_declared()
        """Paths of the attributes in the clip manifest, or None if it cannot be read."""
        self.curves = [self._read_curves(path) for path in (HAIR, GUIDES) if self.stage.GetPrimAtPath(path)]
        self.colliders = [self._read_mesh(prim) for prim in self._collider_prims()]

    @property
    def settings(self) -> dict:
        """The settings that the bake was told; none where the record has none."""
        settings = self.record.get("settings")
        return settings if isinstance(settings, dict) else {}

    @property
    def stepwise(self) -> bool:
        """Whether the frames' files hold all moments to which the solver brought the guides, whichever these are."""
        return self.settings.get("curves") == "steps"

    def frame_path(self, frame: int) -> Path:
        """File of one frame, its number filled up to four characters as USD's clip template does (-1 is `00-1`)."""
        return self.directory / f"hair.{str(frame).rjust(4, '0')}.usdc"

    def moments(self, frame: int) -> list[float]:
        """The times that a frame's file must hold: the frame, and the others evenly over the shutter that the bake was told."""
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
        deforming = [mesh.path for mesh in self.colliders if mesh.deforms]
        paths += [
            f"{curves.path}.{name}"
            for curves in self.curves
            for name in (LEVEL, ACCELERATIONS)
            if self.stage.GetPrimAtPath(curves.path).GetAttribute(name).IsAuthored()
        ]
        return paths + [f"{path}.{name}" for path in deforming for name in ("points", "extent")]

    def _read_declared(self) -> set[str] | None:
        if self.clip is None or not (self.directory / self.clip.manifest).is_file():
            return None
        try:
            layer = Sdf.Layer.OpenAsAnonymous(str(self.directory / self.clip.manifest))
        except Tf.ErrorException:
            return None
        return attributes(layer)

    def _read_record(self) -> dict:
        path = self.directory / RECORD
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise Unreadable(f"{path}: {error}") from error
        if not isinstance(record, dict):
            raise Unreadable(f"{path}: not a JSON object")
        return record

    def _read_clip(self) -> Clip | None:
        clips = Usd.ClipsAPI(self.stage.GetPrimAtPath(GROOM)) if self.stage.GetPrimAtPath(GROOM) else None
        sets = clips.GetClips() if clips else None
        if not sets:
            return None
        values = next(iter(sets.values()))

        def asset(key: str) -> str:
            value = values.get(key, "")
            return value.path if isinstance(value, Sdf.AssetPath) else value

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
        curves = UsdGeom.BasisCurves(prim)
        return Curves(
            path=path,
            counts=array(curves.GetCurveVertexCountsAttr().Get(), int, 1),
            rest=array(UsdGeom.PrimvarsAPI(prim).GetPrimvar("rest").Get(), np.float32, 2),
            widths=array(curves.GetWidthsAttr().Get(), np.float32, 1),
        )

    def _collider_prims(self) -> list[Usd.Prim]:
        parent = self.stage.GetPrimAtPath(COLLIDERS)
        return [prim for prim in parent.GetChildren() if prim.IsA(UsdGeom.Mesh)] if parent else []

    def _read_mesh(self, prim: Usd.Prim) -> Mesh:
        mesh = UsdGeom.Mesh(prim)
        counts = array(mesh.GetFaceVertexCountsAttr().Get(), int, 1)
        indices = array(mesh.GetFaceVertexIndicesAttr().Get(), int, 1)
        rest = UsdGeom.PrimvarsAPI(prim).GetPrimvar("rest")
        points = rest.Get() if rest else mesh.GetPointsAttr().Get()
        return Mesh(
            path=str(prim.GetPath()),
            points=array(points, np.float64, 2),
            deforms=bool(rest),
            triangles=indices.reshape(-1, 3)
            if (counts == 3).all() and len(indices) == 3 * len(counts)
            else np.empty((0, 3), int),
        )


@dataclass(frozen=True)
class FrameFile:
    """The moving values of one frame, from its own file."""

    frame: int
    times: dict[str, list[float]]
    """Sample times of every attribute that the file holds, by path."""
    values: dict[str, np.ndarray]
    """Values at the frame's own time, by path."""
    later: dict[float, dict[str, np.ndarray]]
    """The same at the moments after it."""


def read_frame(cache: Cache, frame: int) -> FrameFile:
    """Reads one frame's file whole. Raises `Unreadable` if it is missing or damaged."""
    path = cache.frame_path(frame)
    if not path.is_file():
        raise Unreadable("no such file")
    times, values, later = {}, {}, {}
    try:
        # Anonymous, so that the layer and its memory go when this function returns.
        layer = Sdf.Layer.OpenAsAnonymous(str(path))
        for name in sorted(attributes(layer)):
            times[name] = list(layer.ListTimeSamplesForPath(name))
            for time in times[name]:
                if time >= frame:
                    at = values if time == frame else later.setdefault(time, {})
                    at[name] = np.array(layer.QueryTimeSample(name, time))
    except Tf.ErrorException as error:
        raise Unreadable(f"damaged: {error.args[0] if error.args else error}") from error
    return FrameFile(frame, times, values, later)


def attributes(layer: Sdf.Layer) -> set[str]:
    """Paths of all attributes that a layer holds."""
    paths = set()
    layer.Traverse(
        Sdf.Path.absoluteRootPath, lambda path: paths.add(str(path)) if path.IsPropertyPath() else None
    )
    return paths


def array(value, dtype, dimensions: int) -> np.ndarray:
    """A USD array in numpy, empty where there is none."""
    if value is None or len(value) == 0:
        return np.empty((0, 3)[:dimensions], dtype)
    return np.array(value, dtype)
