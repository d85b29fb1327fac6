"""Over mode beside the good cache: the stage of a groom, and the motion of the cache over its curves."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

from hairbake_validate.geometry import Array, FloatArray
from validator.good_cache import (
    CURVES,
    FIRST,
    FPS,
    HAIR,
    HANDLES,
    LAST,
    POINTS,
    SAMPLES,
    SHUTTER,
    CacheBuilder,
    declare,
    rest_points,
    transform,
)

CURVES_PATH = "/world/hero/groom/hair"
WHOLE = {CURVES_PATH: range(CURVES)}
"""The curves of the one prim of the stage."""
MOVING = ("points", "velocities", "extent")
KINDS = {
    "points": Sdf.ValueTypeNames.Point3fArray,
    "velocities": Sdf.ValueTypeNames.Vector3fArray,
    "extent": Sdf.ValueTypeNames.Float3Array,
}
WIDTH = 0.01
"""Width of the curves, cm."""


def place(time: float) -> FloatArray:
    """Where the shot places the character, for row vectors, cm, Z up: it turns as it walks."""
    angle = np.radians(30 + 20 * time)
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    matrix[3, :3] = [200 + 50 * time, 50, 0]
    return matrix


TO_METRES = np.array([[0.01, 0, 0, 0], [0, 0, -0.01, 0], [0, 0.01, 0, 0], [0, 0, 0, 1]])
"""From cm, Z up, to m, Y up, for row vectors."""


METADATA = f"""#usda 1.0
(
    defaultPrim = "world"
    metersPerUnit = 0.01
    upAxis = "Z"
    timeCodesPerSecond = {FPS}
    framesPerSecond = {FPS}
    startTimeCode = {FIRST}
    endTimeCode = {LAST}
"""
"""The start of layers over the stage."""


def marked(kind: str) -> str:
    """The start of a layer that a bake puts over the stage, of the kind `over` or `deform`."""
    data = f'string creator = "hairbake 0.1.0"; string hairbake = "{kind}"'
    return f"{METADATA}    customLayerData = {{ {data} }}\n)\n"


def put_over(stage: Path, kind: str, curves: str) -> None:
    """Adds a layer of another bake for some curves to the sublayers of a stage."""
    path = stage.parent / f"another.{kind}.usda"
    path.write_text(marked(kind))
    layer, below = Sdf.Layer.FindOrOpen(str(path)), Sdf.Layer.FindOrOpen(str(stage))
    over = Sdf.CreatePrimInLayer(layer, curves)
    over.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["HoudiniHairDeformAPI"]))
    if kind == "deform":
        UsdGeom.BasisCurves.Define(Usd.Stage.Open(layer), "/hairbake_guides/another/guides")
    layer.Save()
    below.subLayerPaths.append(f"./{path.name}")
    below.Save()


def write_stage(path: Path, parts: dict[str, range] = WHOLE) -> None:
    """Writes a stage with the curves of the good cache, cm, Z up, in a shot that turns and moves them.

    `parts` has the curves of each prim.
    """
    stage = Usd.Stage.CreateNew(str(path))
    declare(stage, 0.01, "Z")
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/world").GetPrim())
    op = UsdGeom.Xform.Define(stage, "/world/hero").AddTransformOp()
    # Between the frames as well, so that it turns smoothly for the moments of the shutter.
    for frame in np.arange(HANDLES[0] - 1, HANDLES[-1] + 2, 0.25):
        op.Set(Gf.Matrix4d(*place((frame - FIRST) / FPS).ravel().tolist()), frame)
    for at, part in parts.items():
        define_curves(stage, at, part)
    for name in ("brown", "red"):
        UsdShade.Material.Define(stage, f"/world/look/{name}")
    fringe = UsdGeom.Subset.Define(stage, f"{CURVES_PATH}/fringe")
    fringe.CreateElementTypeAttr("face")
    fringe.CreateIndicesAttr([1, 4])
    for bound, name in ((CURVES_PATH, "brown"), (f"{CURVES_PATH}/fringe", "red")):
        material = UsdShade.Material.Get(stage, f"/world/look/{name}")
        UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath(bound)).Bind(material)
    stage.Save()


def define_curves(stage: Usd.Stage, path: str, part: range) -> None:
    """Defines a prim with some of the curves of the good cache."""
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreateTypeAttr("cubic")
    curves.CreateWrapAttr("pinned")
    curves.CreateBasisAttr("catmullRom")
    curves.CreateCurveVertexCountsAttr([POINTS] * len(part))
    world = rest_points(CURVES)[part].reshape(-1, 3)
    rest = transform(world, np.linalg.inv(TO_METRES)).astype(np.float32)
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(rest))
    curves.CreateWidthsAttr([WIDTH])
    curves.SetWidthsInterpolation("constant")
    curves.CreatePurposeAttr("render")
    ids = UsdGeom.PrimvarsAPI(curves).CreatePrimvar("hair_id", Sdf.ValueTypeNames.IntArray, "uniform")
    ids.Set(list(part))


def bind_curves(path: Path, at: str = CURVES_PATH) -> None:
    """Adds a skeleton to a stage, which deforms the curves by a binding of the prim `at` or above them."""
    stage = Usd.Stage.Open(str(path))
    UsdSkel.Root.Define(stage, "/world/hero/groom")
    skeleton = UsdSkel.Skeleton.Define(stage, "/world/hero/groom/rig")
    skeleton.CreateJointsAttr(["head"])
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d()])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d()])
    UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath(at)).CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding = UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath(CURVES_PATH))
    binding.CreateJointIndicesPrimvar(True, 1).Set([0])
    binding.CreateJointWeightsPrimvar(True, 1).Set([1.0])
    stage.Save()


class OverCache:
    """The good cache with over mode, and changes to it."""

    def __init__(self, cache: CacheBuilder, parts: dict[str, range] = WHOLE) -> None:
        """Writes a stage with prims of some curves each, siblings, and overs."""
        self.cache, self.parts = cache, parts
        self.stage = cache.directory.parent / "shot.usda"
        write_stage(self.stage, parts)
        for name, text in self._layers().items():
            cache.path(name).write_text(text)
        for frame in HANDLES:
            self._write_frame(frame)
        self.seal()

    def seal(self) -> None:
        """Writes manifest.json with the checksums of the files as they are."""
        self.cache.seal()
        names = ("hair.over.usda", "hair.over.manifest.usda")
        to_rest = TO_METRES.T.tolist()
        prims = [
            {
                "path": path,
                "points": "points",
                "to_rest_m": to_rest,
                "lengthened": False,
                "baked": [{"prim": HAIR, "first": 0, "baked": part.start, "count": len(part)}],
            }
            for path, part in self.parts.items()
        ]

        def change(record: dict[str, Any]) -> None:
            stage = {"stage": self.stage.name, "metres_per_unit": 0.01, "up_axis": "Z"}
            record["over"] = {**stage, "prims": prims}
            record["layers"] += [self.cache.file_record(self.cache.path(name)) for name in names]
            for entry in record["frames"]:
                entry["over"] = self.cache.file_record(self.frame(entry["frame"]))

        self.cache.edit_record(change)

    def frame(self, frame: int) -> Path:
        """File of a frame."""
        return self.cache.path(f"hair.over.{frame}.usdc")

    def edit(self, path: Path, change: Callable[[Sdf.Layer], Any]) -> None:
        """Applies `change(layer)` to a file and updates the checksums."""
        layer = Sdf.Layer.OpenAsAnonymous(str(path))
        change(layer)
        layer.Export(str(path))
        self.seal()

    def edit_stage(self, name: str, change: Callable[[Usd.Stage], Any]) -> None:
        """Applies `change(stage)` to a text layer of the cache and updates the checksums."""
        self.edit(self.cache.path(name), lambda layer: change(Usd.Stage.Open(layer)))

    def edit_array(self, frame: int, name: str, change: Callable[[Array], Array], prim: int = 0) -> None:
        """Replaces an array of a prim in a frame's file by `change(array)`."""
        path = f"/over/curves{prim}.{name}"

        def rewrite(layer: Sdf.Layer) -> None:
            value = layer.QueryTimeSample(path, float(frame))
            changed = np.ascontiguousarray(change(np.array(value)), np.float32)
            layer.SetTimeSample(path, float(frame), type(value).FromNumpy(changed))

        self.edit(self.frame(frame), rewrite)

    def _layers(self) -> dict[str, str]:
        def clips(number: int) -> str:
            return f"""
    clips = {{
        dictionary hairbake = {{
            asset manifestAssetPath = @./hair.over.manifest.usda@
            string primPath = "/over/curves{number}"
            string templateAssetPath = "./hair.over.####.usdc"
            double templateStartTime = {HANDLES[0]}
            double templateEndTime = {HANDLES[-1]}
            double templateStride = 1
        }}
    }}
    prepend clipSets = ["hairbake"]
"""

        names = [Sdf.Path(path).name for path in self.parts]
        over = "".join(f'over "{name}" (\n{clips(i)})\n{{\n}}\n' for i, name in enumerate(names))
        for name in ("groom", "hero", "world"):
            over = f'over "{name}"\n{{\n{over}}}\n'
        declared = "\n".join(f"{kind} {name}" for name, kind in KINDS.items())
        prims = "".join(f'over "curves{i}"\n{{\n{declared}\n}}\n' for i in range(len(names)))
        return {
            "hair.over.usda": f"{marked('over')}\n{over}",
            "hair.shot.usda": f"{METADATA}    subLayers = [@./hair.over.usda@, @../shot.usda@]\n)\n",
            "hair.over.manifest.usda": f'#usda 1.0\n\nover "over"\n{{\n{prims}}}\n',
        }

    def _write_frame(self, frame: int) -> None:
        layer = Sdf.Layer.CreateNew(str(self.frame(frame)))
        for number, part in enumerate(self.parts.values()):
            self._write_prim(layer, frame, f"/over/curves{number}", part)
        layer.Save()

    def _write_prim(self, layer: Sdf.Layer, frame: int, path: str, part: range) -> None:
        prim = Sdf.CreatePrimInLayer(layer, path)
        for name, kind in KINDS.items():
            Sdf.AttributeSpec(prim, name, kind)
        points = slice(part.start * POINTS, part.stop * POINTS)
        source = Sdf.Layer.OpenAsAnonymous(str(self.cache.frame(frame)))
        for at in (frame + SHUTTER * i / (SAMPLES - 1) for i in range(SAMPLES)):
            world = np.array(source.QueryTimeSample(f"{HAIR}.points", at), float)[points]
            speed = np.array(source.QueryTimeSample(f"{HAIR}.velocities", at), float)[points]
            time, step = (at - FIRST) / FPS, 1e-4
            now, before, after = (
                transform(world + speed * shift, np.linalg.inv(place(time + shift) @ TO_METRES))
                for shift in (0, -step, step)
            )
            values = {
                "points": now,
                "velocities": (after - before) / (2 * step),
                "extent": np.stack([now.min(0) - WIDTH / 2, now.max(0) + WIDTH / 2]),
            }
            for name, value in values.items():
                layer.SetTimeSample(f"{path}.{name}", at, Vt.Vec3fArray.FromNumpy(value.astype(np.float32)))
