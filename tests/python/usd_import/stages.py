"""Stages that tests author, and grooms read back."""

import json
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, Vt

FLOATS = Sdf.ValueTypeNames.FloatArray
INTS, UVS, NAMES = (
    Sdf.ValueTypeNames.IntArray,
    Sdf.ValueTypeNames.TexCoord2fArray,
    Sdf.ValueTypeNames.StringArray,
)


class Groom:
    """groom.json with its buffer."""

    NUMBERS = {"f32": "<f4", "f64": "<f8", "i32": "<i4", "u32": "<u4"}

    def __init__(self, path: Path):
        self.file, self.folder = json.loads(path.read_text()), path.parent

    def array(self, *keys) -> np.ndarray:
        value = self.file
        for key in keys:
            value = value[key]
        if not isinstance(value, dict):
            return np.array(value)
        scalar, _, width = value["type"].partition("x")
        data = (self.folder / self.file["buffers"][value["buffer"]]["uri"]).read_bytes()
        flat = np.frombuffer(data, self.NUMBERS[scalar], value["count"] * int(width or 1), value["offset"])
        return flat.reshape(value["count"], -1) if width else flat


def hanging(count: int, vertices: int = 6, length: float = 0.2) -> np.ndarray:
    """Strands in a row, metres, Y up, which hang down and bend away: (count × vertices × 3)."""
    s = np.linspace(0, 1, vertices)
    root = np.stack([0.02 * np.arange(count), np.full(count, 1.5), np.zeros(count)], axis=1)
    way = np.stack([0 * s, -length * s, 0.3 * length * s**2], axis=1)
    return root[:, None] + way


def new_stage(path: Path, unit: float | None = 1.0, up: str | None = "Y") -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(path))
    if unit is not None:
        UsdGeom.SetStageMetersPerUnit(stage, unit)
    if up is not None:
        UsdGeom.SetStageUpAxis(stage, up)
    return stage


def add_curves(
    stage, path: str, points, kind="cubic", basis="catmullRom", wrap="pinned", counts=None
) -> UsdGeom.BasisCurves:
    points = np.asarray(points, np.float32)
    if counts is None:
        counts = [points.shape[1]] * len(points)
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreateTypeAttr(kind)
    curves.CreateBasisAttr(basis)
    curves.CreateWrapAttr(wrap)
    curves.CreateCurveVertexCountsAttr(counts)
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3)))
    return curves


def add_primvar(prim, name: str, kind, interpolation: str, values) -> None:
    UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, kind, interpolation).Set(values)
