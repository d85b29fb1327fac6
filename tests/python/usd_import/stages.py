"""Stages that tests author, and grooms that the program writes."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pxr import Sdf, Usd, UsdGeom, Vt

from hairbake_usd.exchange import TYPES, Array, FloatArray

FLOATS, INTS = Sdf.ValueTypeNames.FloatArray, Sdf.ValueTypeNames.IntArray
UVS, NAMES = Sdf.ValueTypeNames.TexCoord2fArray, Sdf.ValueTypeNames.StringArray


class Groom:
    """groom.json with its buffer."""

    def __init__(self, path: Path) -> None:
        """Reads groom.json."""
        self.file, self.folder = json.loads(path.read_text()), path.parent

    def array(self, *keys: str) -> Array:
        """The array at a path of keys, from the file or its buffer."""
        value = self.file
        for key in keys:
            value = value[key]
        if not isinstance(value, dict):
            return np.array(value)
        scalar, _, width = value["type"].partition("x")
        data = (self.folder / self.file["buffers"][value["buffer"]]["uri"]).read_bytes()
        flat = np.frombuffer(data, TYPES[scalar], value["count"] * int(width or 1), value["offset"])
        return flat.reshape(value["count"], -1) if width else flat


Imports = Callable[..., tuple[Groom, str]]
"""Imports a groom with options, and returns it with the messages."""
Refused = Callable[..., str]
"""Runs a command that must be refused, and returns its message."""


def hanging(count: int, vertices: int = 6, length: float = 0.2) -> FloatArray:
    """Strands in a row that hang down and bend away, m, Y up; `count × vertices × 3`."""
    s = np.linspace(0, 1, vertices)
    root = np.stack([0.02 * np.arange(count), np.full(count, 1.5), np.zeros(count)], axis=1)
    shape = np.stack([0 * s, -length * s, 0.3 * length * s**2], axis=1)
    return root[:, None] + shape


def new_stage(path: Path, unit: float | None = 1.0, up: str | None = "Y") -> Usd.Stage:
    """An empty stage, with unit and axis unless they are None."""
    stage = Usd.Stage.CreateNew(str(path))
    if unit is not None:
        UsdGeom.SetStageMetersPerUnit(stage, unit)
    if up is not None:
        UsdGeom.SetStageUpAxis(stage, up)
    return stage


def add_curves(
    stage: Usd.Stage,
    path: str,
    points: ArrayLike,
    *,
    basis: str = "catmullRom",
    wrap: str = "pinned",
    counts: Sequence[int] | None = None,
) -> UsdGeom.BasisCurves:
    """Cubic curves through `points`, `count × vertices × 3`, or of other `counts`."""
    array = np.asarray(points, np.float32)
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreateTypeAttr("cubic")
    curves.CreateBasisAttr(basis)
    curves.CreateWrapAttr(wrap)
    curves.CreateCurveVertexCountsAttr([array.shape[1]] * len(array) if counts is None else counts)
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(array.reshape(-1, 3)))
    return curves


def add_primvar(prim: Any, name: str, kind: Sdf.ValueTypeName, interpolation: str, values: Any) -> None:
    """A primvar with a default value."""
    UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, kind, interpolation).Set(values)
