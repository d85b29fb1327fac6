"""The curves of another stage that Houdini deforms by the guides of a cache."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from .cache import GROOM, Cache, array
from .geometry import Array, FloatArray, IntArray, transformed
from .overs import GUIDES_ROOT, ShotStage, opened, rest_time

SCHEMA = "HoudiniHairDeformAPI"
PREFIX = "houdini:hairdeform:"
WEIGHTS, SHAPES = "guideweights", "guideshapeinterpolation"
"""The methods that a bake asks for."""
LISTS = tuple(f"primvars:{name}{suffix}" for name in ("guides", "weights") for suffix in ("", ":lengths"))
"""The guides of each curve, and their weights."""


@dataclass(frozen=True)
class DeformPrim:
    """Curves of the stage, and what manifest.json holds of them."""

    path: str
    points: FloatArray
    """Control points at rest, in the space of the prim."""
    counts: IntArray
    """Control points of each curve."""
    to_rest: FloatArray
    """Matrix from the space of the prim to rest space, m, Y up, for row vectors."""
    method: str
    guides: str
    """Path of the guides in the composed stage."""
    skin: str
    """Path of the mesh that carries the roots in the composed stage."""

    @cached_property
    def roots(self) -> FloatArray:
        """The first control point of each curve in rest space, m, Y up."""
        starts = np.cumsum(self.counts) - self.counts
        return transformed(self.points[starts], self.to_rest)

    def in_cache(self, path: str) -> str:
        """Path in the cache of a prim of the composed stage, which refers to it."""
        reference = Sdf.Path(path).GetPrefixes()[1]
        return str(Sdf.Path(path).ReplacePrefix(reference, Sdf.Path(GROOM)))


class Deforms(ShotStage):
    """The layer beside a cache, and the stage that it is for."""

    kind, name = "deform", "hair.deform.usda"

    def __init__(self, cache: Cache) -> None:
        """Opens the composed stage and the one below it.

        Raises:
            CacheError: They cannot be opened, or do not have the curves that manifest.json lists.
        """
        super().__init__(cache)
        self.prims = [read_prim(prim, entry) for prim, entry in self.entries()]

    def value(self, path: str, name: str, time: float | None = None) -> Any:
        """A value of the composed stage; None if there is none."""
        prim = self.shot.GetPrimAtPath(path)
        attribute = prim.GetAttribute(name) if prim else None
        return attribute.Get(Usd.TimeCode.Default() if time is None else time) if attribute else None

    def targets(self, path: str, name: str) -> list[str]:
        """The targets of a relationship of the schema."""
        relationship = self.shot.GetPrimAtPath(path).GetRelationship(PREFIX + name)
        return [str(target) for target in relationship.GetTargets()] if relationship else []

    def at_rest(self, prim: DeformPrim, path: str) -> FloatArray:
        """Places at rest of guides or a skin, in the space of a prim, `n × 3`."""
        return array(self.value(path, "primvars:rest"), np.float64, 2).reshape(-1, 3)

    def in_world(self, path: str, frame: float) -> FloatArray:
        """Points of guides or a skin in the world, m, Y up, as the composed stage places them."""
        points = array(self.value(path, "points", frame), np.float64, 2).reshape(-1, 3)
        place = UsdGeom.Imageable(self.shot.GetPrimAtPath(path)).ComputeLocalToWorldTransform(frame)
        return transformed(points, np.array(place) @ self.to_metres)


def deforms_of(cache: Cache) -> Deforms | None:
    """The layer of a cache, if it has one that can be opened."""
    found = opened(cache, Deforms)
    return found if isinstance(found, Deforms) else None


def read_prim(prim: Usd.Prim, entry: dict[str, Any]) -> DeformPrim:
    """The curves of a prim, and what manifest.json holds of them."""
    time = rest_time(entry)
    if not all(entry[name].startswith(f"/{GUIDES_ROOT}/") for name in ("guides", "skin")):
        raise ValueError(f"{entry['path']} is deformed by {entry['guides']} on {entry['skin']}")
    counts: Array = array(UsdGeom.BasisCurves(prim).GetCurveVertexCountsAttr().Get(time), int, 1)
    return DeformPrim(
        path=entry["path"],
        points=array(prim.GetAttribute(entry["points"]).Get(time), np.float64, 2),
        counts=counts,
        to_rest=np.array(entry["to_rest_m"], float).T,
        method=entry["method"],
        guides=entry["guides"],
        skin=entry["skin"],
    )
