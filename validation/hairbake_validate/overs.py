"""Over mode: the motion of a cache, put over the curves of another stage."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.polynomial import polynomial
from pxr import Sdf, Tf, Usd, UsdGeom, UsdSkel

from .cache import SHOT_LAYER, Cache, CacheError, Curves, FrameFile, array, frame_file_name, read_layer
from .geometry import FloatArray, IntArray

OVER_MANIFEST = "hair.over.manifest.usda"
CLIP_SET = "hairbake"
GUIDES_ROOT = "hairbake_guides"
"""Name of the prim that holds the guides by which Houdini deforms curves."""
NORMALS = ("normals", "primvars:normals")
MOVING = ("points", "velocities", "accelerations", "extent", *NORMALS)
"""What moves of curves: all that over mode may change."""
SKELETON = "skel:skeleton"
"""The relationship that over mode clears on curves that a skeleton would move again."""
SKELETON_SCHEMA = "SkelBindingAPI"
"""The schema without which USD ignores that relationship, which over mode applies with it."""

BASES = {
    "bezier": ((1, -3, 3, -1), (0, 3, -6, 3), (0, 0, 3, -3), (0, 0, 0, 1)),
    "bspline": ((1 / 6, -0.5, 0.5, -1 / 6), (2 / 3, 0, -1, 0.5), (1 / 6, 0.5, 0.5, -0.5), (0, 0, 0, 1 / 6)),
    "catmullRom": ((0, -0.5, 1, -0.5), (1, 0, -2.5, 1.5), (0, 0.5, 2, -1.5), (0, 0, -0.5, 0.5)),
}
"""Weight of each control point of a segment as a polynomial, constant first (UsdGeomBasisCurves)."""


@dataclass(frozen=True)
class Run:
    """Curves of a prim that follow each other, as do the curves of the cache that they move as."""

    prim: str
    """Path of the curves in the cache."""
    first: int
    """The first curve of the prim."""
    baked: int
    """The first curve of the cache."""
    count: int

    def points(self, curves: Curves) -> slice:
        """The points of the curves of the cache, of which `curves` are all."""
        last = self.baked + self.count - 1
        return slice(int(curves.starts[self.baked]), int(curves.starts[last] + curves.counts[last]))


@dataclass(frozen=True)
class OverPrim:
    """Curves of the stage as it was."""

    path: str
    clip_path: str
    """Path of the prim in the files of frames."""
    type: tuple[str, ...]
    """Type, basis and wrap."""
    counts: IntArray
    """Control points of each curve."""
    rest: FloatArray
    """Control points in rest space, m, Y up."""
    width: float
    """The largest diameter."""
    normals: str | None
    """The attribute of the normals that the files of frames hold."""
    values: int
    """The number of normals."""
    lengthened: bool
    """True if the importer changed the length of the curves."""
    runs: list[Run]

    @cached_property
    def starts(self) -> IntArray:
        """Index of each curve's first control point."""
        starts: IntArray = np.cumsum(self.counts) - self.counts
        return starts

    def weights(self, count: int, per_segment: int) -> FloatArray:
        """Points of a curve with `count` control points as weights of these, root first."""
        kind, basis, wrap = self.type
        eye = np.eye(count)
        if kind == "linear":
            places = np.linspace(0, count - 1, (count - 1) * per_segment + 1)
            return np.array([np.interp(places, np.arange(count), row) for row in eye]).T
        step = 3 if basis == "bezier" else 1
        if wrap == "pinned" and basis != "bezier":
            eye = np.vstack([2 * eye[0] - eye[1], eye, 2 * eye[-1] - eye[-2]])
        segments = (len(eye) - 4) // step + 1
        at = [(s, i / per_segment) for s in range(segments) for i in range(per_segment)]
        polynomials = np.array(BASES[basis]).T
        return np.array(
            [
                polynomial.polyval(u, polynomials) @ eye[step * s : step * s + 4]
                for s, u in [*at, (segments - 1, 1.0)]
            ]
        )


class ShotStage:
    """`hair.shot.usda` beside a cache, and the stage below the layer that a bake puts over it.

    What other bakes put over the stage is left out of both: it may be for other characters.
    """

    kind: ClassVar[str]
    """Mark of the layer, and what manifest.json calls it."""
    name: ClassVar[str]
    """File name of the layer."""

    def __init__(self, cache: Cache) -> None:
        """Opens both stages, and the layer.

        Raises:
            CacheError: They cannot be opened.
        """
        self.cache, self.record = cache, cache.record[self.kind]
        shot = cache.directory / SHOT_LAYER
        try:
            self.layer = Sdf.Layer.FindOrOpen(str(cache.directory / self.name))
            self.shot = Usd.Stage.Open(str(shot))
            below = [path for path in self.shot.GetRootLayer().subLayerPaths if path != f"./{self.name}"]
            self.stage_path = self.shot.GetRootLayer().ComputeAbsolutePath(below[0]) if below else ""
            self.original = Usd.Stage.Open(self.stage_path)
        except Tf.ErrorException as error:
            raise CacheError(f"{shot}: {error.args[0].commentary if error.args else error}") from error
        if not self.layer:
            raise CacheError(f"{self.name}: no such file")
        self.others = sorted(self._doubled())
        """Layers of the other kind over the same curves."""
        # The stage below is what it is, even if it was made from the layer of a bake.
        below_it = self.original.GetRootLayer()
        for stage, kept in ((self.shot, (below_it, self.layer)), (self.original, (below_it,))):
            used = stage.GetUsedLayers(False)
            baked = [layer.identifier for layer in used if baked_kind(layer) and layer not in kept]
            stage.MuteAndUnmuteLayers(baked, [])
        self.to_metres = to_metres(self.record["metres_per_unit"], self.record["up_axis"])

    def _doubled(self) -> set[str]:
        prims = (self.shot.GetPrimAtPath(entry["path"]) for entry in self.record["prims"])
        layers = [spec.layer for prim in prims if prim for spec in prim.GetPrimStack()]
        return {layer.identifier for layer in layers if baked_kind(layer) not in (None, self.kind)}

    def entries(self) -> Iterator[tuple[Usd.Prim, dict[str, Any]]]:
        """The curves that manifest.json lists, in the stage below, and what it holds of each.

        Raises:
            CacheError: The stage does not have them.
        """
        for entry in self.record["prims"]:
            prim = self.original.GetPrimAtPath(entry["path"])
            if not prim or not prim.IsA(UsdGeom.BasisCurves):
                raise CacheError(f"{entry['path']}: no BasisCurves in {self.stage_path}")
            yield prim, entry


class Overs(ShotStage):
    """The layers of over mode beside a cache, and the stage that they are for."""

    kind, name = "over", "hair.over.usda"

    def __init__(self, cache: Cache) -> None:
        """Opens the composed stage and the one below it.

        Raises:
            CacheError: They cannot be opened, or do not have the curves that manifest.json lists.
        """
        super().__init__(cache)
        self.frame_paths = {
            frame: cache.directory / frame_file_name("hair.over", frame) for frame in cache.frames
        }
        self.prims = [read_prim(prim, number, entry) for number, (prim, entry) in enumerate(self.entries())]

    def to_world(self, prim: OverPrim, frame: float) -> FloatArray:
        """Matrix from the space of a prim to world in metres, Y up, for row vectors."""
        imageable = UsdGeom.Imageable(self.shot.GetPrimAtPath(prim.path))
        matrix: FloatArray = np.array(imageable.ComputeLocalToWorldTransform(frame)) @ self.to_metres
        return matrix

    def read(self, frame: int) -> FrameFile:
        """Reads the file of a frame.

        Raises:
            CacheError: The file is missing or damaged.
        """
        return read_layer(self.frame_paths[frame], frame)


@lru_cache(maxsize=2)
def opened(cache: Cache, layers: type[ShotStage]) -> ShotStage | CacheError | None:
    """The layers of a kind beside a cache; None if it has none; the error if they cannot be opened."""
    if not cache.record.get(layers.kind):
        return None
    try:
        return layers(cache)
    except CacheError as error:
        return error
    except (KeyError, TypeError, ValueError) as error:
        return CacheError(f'manifest.json: "{layers.kind}" is not as docs/cache.md describes it: {error!r}')


def overs_of(cache: Cache) -> Overs | None:
    """The overs of a cache, if it has any that can be opened."""
    found = opened(cache, Overs)
    return found if isinstance(found, Overs) else None


def baked_kind(layer: Sdf.Layer) -> str | None:
    """What a layer of a bake does to the stage below it, `over` or `deform`; None for all other layers."""
    kind = layer.customLayerData.get("hairbake")
    return kind if kind in ("over", "deform") else None


def to_metres(metres_per_unit: float, up_axis: str) -> FloatArray:
    """Matrix from a unit and axes to metres, Y up, for row vectors."""
    matrix = np.eye(4)
    if up_axis == UsdGeom.Tokens.z:
        matrix[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    matrix[:3, :3] *= metres_per_unit
    return matrix


def stage_to_metres(stage: Usd.Stage) -> FloatArray:
    """Matrix from the declared unit and axes of a stage to metres, Y up, for row vectors."""
    return to_metres(UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage))


def deformed(stage: Usd.Stage, paths: list[str]) -> set[str]:
    """Those of some prims whose points skeletons or blend shapes of a stage move."""
    roots = {root.GetPath(): root for path in paths if (root := UsdSkel.Root.Find(stage.GetPrimAtPath(path)))}
    cache, found = UsdSkel.Cache(), set()
    for root in roots.values():
        cache.Populate(root, Usd.PrimDefaultPredicate)
        for binding in cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate):
            queries = binding.GetSkinningTargets()
            moved = (query for query in queries if query.HasJointInfluences() or query.HasBlendShapes())
            found |= {str(query.GetPrim().GetPath()) for query in moved}
    return found & set(paths)


def rest_time(entry: dict[str, Any]) -> Usd.TimeCode:
    """The time at which curves are at rest."""
    at = entry.get("time")
    return Usd.TimeCode.Default() if at is None else Usd.TimeCode(at)


def read_prim(prim: Usd.Prim, number: int, entry: dict[str, Any]) -> OverPrim:
    """The curves of a prim, and what manifest.json holds of them."""
    curves = UsdGeom.BasisCurves(prim)
    time = rest_time(entry)
    points = array(prim.GetAttribute(entry["points"]).Get(time), np.float64, 2)
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("widths")
    widths = primvar.Get(time) if primvar and primvar.HasValue() else curves.GetWidthsAttr().Get(time)
    normals = entry.get("normals")
    to_rest = np.array(entry["to_rest_m"], float).T
    return OverPrim(
        path=entry["path"],
        clip_path=f"/over/curves{number}",
        type=tuple(
            str(attr.Get()) for attr in (curves.GetTypeAttr(), curves.GetBasisAttr(), curves.GetWrapAttr())
        ),
        counts=array(curves.GetCurveVertexCountsAttr().Get(time), int, 1),
        rest=points @ to_rest[:3, :3] + to_rest[3, :3],
        width=float(np.max(widths if widths is not None else 0.0, initial=0.0)),
        normals=normals,
        values=len(prim.GetAttribute(normals).Get(time)) if normals else 0,
        lengthened=entry.get("lengthened", False),
        runs=[Run(**run) for run in entry["baked"]],
    )
