"""A character with hair in a shot, which bakes are put over."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

from support import Run
from usd_import.stages import add_curves, add_primvar, hanging, new_stage

FIRST, LAST = 1001, 1006
FRAMES = range(FIRST - 1, LAST + 2)
STRANDS, POINTS = 12, 7
HAIR = "/world/hero/char/hair"
QUICK = ("--substeps", "2", "--preroll", "0.1", "--no-pictures")


class Shot:
    """A character in a shot: referenced, placed, turned as it walks; Z up."""

    def __init__(
        self,
        folder: Path,
        hairbake: Run,
        basis: str = "bspline",
        wrap: str = "pinned",
        units: float = 100,
        declared: float | None = 0.01,
        *,
        first: int = FIRST,
    ) -> None:
        """Writes the asset and the shot, with so many units per metre, and what they declare of them.

        The shot starts at the frame `first`.
        """
        self.first, self.last = first, first + LAST - FIRST
        self.folder, self.hairbake, self.units, self.declared = folder, hairbake, units, declared
        self.asset, self.shot = folder / "char.usda", folder / "shot.usda"
        self._write_asset(basis, wrap)
        self._write_shot()

    def _write_asset(self, basis: str, wrap: str) -> None:
        stage = new_stage(self.asset, self.declared, "Z")
        stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/char").GetPrim())
        UsdGeom.Xform.Define(stage, "/char/head").AddTranslateOp().Set(Gf.Vec3d(0, 0, 1.5 * self.units))
        points = hanging(STRANDS, POINTS)
        points = np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)
        # Not straight, so that a curve is not its control points.
        points[:, 1::2, 1] += 0.008
        points *= self.units
        if (basis, wrap) in (("bspline", "nonperiodic"), ("catmullRom", "nonperiodic")):
            # The curve starts between the first and the third control point.
            points[:, 0] = 2 * points[:, 1] - points[:, 2]
        curves = add_curves(
            stage, "/char/hair", points, basis="bspline" if basis == "linear" else basis, wrap=wrap
        )
        if basis == "linear":
            curves.GetTypeAttr().Set("linear")
        curves.CreateWidthsAttr([1e-4 * self.units])
        curves.SetWidthsInterpolation("constant")
        curves.CreatePurposeAttr("render")
        add_primvar(curves, "hair_id", Sdf.ValueTypeNames.IntArray, "uniform", list(range(STRANDS)))
        subset = UsdGeom.Subset.Define(stage, "/char/hair/fringe")
        subset.CreateElementTypeAttr("face")
        subset.CreateIndicesAttr([1, 3])
        material = UsdShade.Material.Define(stage, "/char/look/hair")
        UsdShade.MaterialBindingAPI.Apply(curves.GetPrim()).Bind(material)
        stage.Save()

    def _write_shot(self) -> None:
        stage = new_stage(self.shot, self.declared, "Z")
        stage.SetTimeCodesPerSecond(24)
        stage.SetFramesPerSecond(24)
        stage.SetStartTimeCode(self.first)
        stage.SetEndTimeCode(self.last)
        stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/world").GetPrim())
        hero = UsdGeom.Xform.Define(stage, "/world/hero")
        walk, turn = hero.AddTranslateOp(), hero.AddRotateZOp()
        stage.DefinePrim("/world/hero/char").GetReferences().AddReference("./char.usda")
        nod = UsdGeom.Xform(stage.OverridePrim("/world/hero/char/head")).AddRotateXOp()
        for frame in range(self.first - 8, self.last + 9):
            time = (frame - self.first) / 24
            walk.Set(Gf.Vec3d(2 + 0.6 * time, 0.5, 0) * self.units, frame)
            turn.Set(30 + 90 * time, frame)
            nod.Set(15 * float(np.sin(6 * time)), frame)
        stage.Save()

    def edit(self, path: Path, change: Callable[[Usd.Stage], Any]) -> None:
        """Applies `change(stage)` to a stage."""
        stage = Usd.Stage.Open(str(path))
        change(stage)
        stage.Save()

    def bind(self, at: str, shapes: bool = False) -> None:
        """Adds a skeleton to the asset, bound at a prim, which moves the curves by joints or blend shapes."""

        def change(stage: Usd.Stage) -> None:
            stage.GetPrimAtPath("/char").SetTypeName("SkelRoot")
            skeleton = UsdSkel.Skeleton.Define(stage, "/char/rig")
            skeleton.CreateJointsAttr(["head"])
            pose = Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0, 150))
            skeleton.CreateBindTransformsAttr([pose])
            skeleton.CreateRestTransformsAttr([pose])
            binding = UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath(at))
            binding.CreateSkeletonRel().SetTargets(["/char/rig"])
            if shapes:
                shape = UsdSkel.BlendShape.Define(stage, "/char/hair/windy")
                shape.CreateOffsetsAttr([(1.0, 0.0, 0.0)] * STRANDS * POINTS)
                binding.CreateBlendShapesAttr(["windy"])
                binding.CreateBlendShapeTargetsRel().SetTargets([shape.GetPath()])
                return
            binding.CreateJointIndicesPrimvar(True, 1).Set([0])
            binding.CreateJointWeightsPrimvar(True, 1).Set([1.0])

        self.edit(self.asset, change)

    def shorten(self, curve: int) -> None:
        """Makes a curve of the asset shorter than a millimetre: the importer drops it."""

        def change(stage: Usd.Stage) -> None:
            points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/char/hair")).GetPointsAttr()
            each = np.array(points.Get()).reshape(STRANDS, POINTS, 3)
            each[curve] = each[curve, :1] + 0.001 * (each[curve] - each[curve, :1])
            points.Set(Vt.Vec3fArray.FromNumpy(each.reshape(-1, 3)))

        self.edit(self.asset, change)

    def run(self, *arguments: object) -> str:
        """Runs the program, which must succeed; returns its messages."""
        done = self.hairbake(*arguments)
        assert done.returncode == 0, done.stderr
        return done.stderr

    def imported(
        self, *options: object, stage: Path | None = None, track: tuple[object, ...] = ()
    ) -> tuple[Path, Path]:
        """Imports groom and track, with options of both or of the track."""
        groom, anim = self.folder / "groom.json", self.folder / "anim.json"
        prim = "/char" if stage == self.asset else "/world/hero/char"
        source = stage or self.shot
        self.run("import", "groom", source, "--prim", prim, "--guides", 4, *options, "-o", groom)
        head = ("--prim", f"{HAIR[:-5]}/head")
        self.track = self.run("import", "track", self.shot, *head, *track, "--groom", groom, "-o", anim)
        return groom, anim

    def baked(self, *options: object, stage: Path | None = None) -> Path:
        """Folder of a bake with everything by default."""
        out = self.folder / "out"
        self.run(*self.imported(stage=stage), "-o", out, *QUICK, *options)
        return out
