"""The good cache with the layer by which Houdini deforms curves of another stage by its guides."""

from collections.abc import Callable
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from validator.good_cache import CURVES, GUIDE_COUNT, GUIDES, SKULL, CacheBuilder, transform
from validator.over_cache import CURVES_PATH, METADATA, TO_METRES, marked, write_stage

ROOT = "/hairbake_guides/world_hero_groom_hair"
GUIDES_PATH, SKIN_PATH = f"{ROOT}/guides", f"{ROOT}/colliders/skull"
PREFIX = "houdini:hairdeform:"
INTS, FLOATS = Sdf.ValueTypeNames.IntArray, Sdf.ValueTypeNames.FloatArray


class DeformCache:
    """The good cache with the layer, and changes to it."""

    def __init__(self, cache: CacheBuilder) -> None:
        """Writes a stage and the layer."""
        self.cache = cache
        self.stage = cache.directory.parent / "shot.usda"
        self.layer = cache.path("hair.deform.usda")
        write_stage(self.stage)
        sublayers = "    subLayers = [@./hair.deform.usda@, @../shot.usda@]\n)\n"
        cache.path("hair.shot.usda").write_text(METADATA + sublayers)
        self.layer.write_text(marked("deform"))
        self.edit(self._write)

    def seal(self) -> None:
        """Writes manifest.json with the checksums of the files as they are."""
        self.cache.seal()
        prim = {
            "path": CURVES_PATH,
            "points": "points",
            "to_rest_m": TO_METRES.T.tolist(),
            "method": "guideweights",
            "guides": GUIDES_PATH,
            "skin": SKIN_PATH,
        }

        def change(record: dict[str, Any]) -> None:
            stage = {"stage": self.stage.name, "metres_per_unit": 0.01, "up_axis": "Z"}
            record["deform"] = {**stage, "prims": [prim]}
            record["layers"].append(self.cache.file_record(self.layer))

        self.cache.edit_record(change)

    def edit(self, change: Callable[[Usd.Stage], Any]) -> None:
        """Applies `change(stage)` to the layer and updates the checksums."""
        stage = Usd.Stage.Open(str(self.layer))
        change(stage)
        stage.Save()
        self.seal()

    def on_curves(self, change: Callable[[Usd.Prim], Any]) -> None:
        """Applies `change(prim)` to the overs of the curves."""
        self.edit(lambda stage: change(stage.OverridePrim(CURVES_PATH)))

    def on_stage(self, change: Callable[[Usd.Stage], Any]) -> None:
        """Applies `change(stage)` to the stage below."""
        stage = Usd.Stage.Open(str(self.stage))
        change(stage)
        stage.Save()

    def _write(self, stage: Usd.Stage) -> None:
        UsdGeom.Scope.Define(stage, "/hairbake_guides").CreatePurposeAttr("guide")
        place = UsdGeom.Xform.Define(stage, ROOT)
        place.GetPrim().GetReferences().AddReference("./hair.usda", "/groom")
        place.AddTransformOp().Set(Gf.Matrix4d(*np.linalg.inv(TO_METRES).ravel().tolist()))
        cache = Usd.Stage.Open(str(self.cache.path("hair.usda")))
        for path, source, name in (
            (GUIDES_PATH, GUIDES, "primvars:rest"),
            (SKIN_PATH, SKULL, "points"),
        ):
            rest = np.array(cache.GetPrimAtPath(source).GetAttribute(name).Get(), float)
            rest = transform(rest, np.linalg.inv(TO_METRES)).astype(np.float32)
            primvars = UsdGeom.PrimvarsAPI(stage.OverridePrim(path))
            primvar = primvars.CreatePrimvar("rest", Sdf.ValueTypeNames.Point3fArray, "vertex")
            primvar.Set(Vt.Vec3fArray.FromNumpy(rest))
        prim = stage.OverridePrim(CURVES_PATH)
        prim.AddAppliedSchema("HoudiniHairDeformAPI")
        method = prim.CreateAttribute(
            f"{PREFIX}deformmethod", Sdf.ValueTypeNames.String, False, Sdf.VariabilityUniform
        )
        method.Set("guideweights")
        prim.CreateRelationship(f"{PREFIX}deformerPrim", False).SetTargets([GUIDES_PATH])
        prim.CreateRelationship(f"{PREFIX}skinPrim", False).SetTargets([SKIN_PATH])
        primvars = UsdGeom.PrimvarsAPI(prim)
        pairs = [(i % GUIDE_COUNT, (i + 1) % GUIDE_COUNT) for i in range(CURVES)]
        for name, kind, values in (
            ("guides", INTS, [guide for pair in pairs for guide in pair]),
            ("weights", FLOATS, [0.75, 0.25] * CURVES),
        ):
            primvars.CreatePrimvar(name, kind, "constant").Set(values)
            # An attribute: USD makes no primvar of a name with a second colon.
            lengths = prim.CreateAttribute(f"primvars:{name}:lengths", INTS, False)
            lengths.Set([2] * CURVES)
            UsdGeom.Primvar(lengths).SetInterpolation("uniform")
