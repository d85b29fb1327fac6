"""A character as a studio has it: skinned, its groom behind a payload, in a shot that places it twice.

`groom.usd` holds two variants of curves with materials, a subset, ids and primvars, and guides; `char.usd` a
skeleton with a skinned body; `shot.usda` the character, placed and turned as it walks, and an instance of it.
Centimetres, Z up, 24 frames a second.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

from hairbake_validate.geometry import BoolArray, FloatArray, IntArray

FIRST, LAST = 101, 124
RUN_UP = 12
"""Frames before the first that the shot has samples of."""
HAIR = "/world/hero/char/hairgroom/scalp_hair"
INSTANCE = "/world/extra/char/hairgroom/scalp_hair"
CHARACTER = "/world/hero/char"
HEAD = np.array([10.0, 10.0, 11.0])
"""Semi-axes of the head, whose centre is 170 above the ground."""
VARIANTS = {"hi": 900, "lo": 120}
JOINTS = ["root", "root/spine", "root/spine/head"]
TYPES = Sdf.ValueTypeNames


@dataclass(frozen=True)
class Drawn:
    """How the curves are drawn."""

    basis: str
    wrap: str

    @property
    def name(self) -> str:
        """Name for tables."""
        return self.basis if self.basis in ("linear", "bezier") else f"{self.basis}, {self.wrap}"

    def counts(self, random: np.random.Generator, curves: int) -> IntArray:
        """Control points of each curve."""
        free = random.integers(7, 13, curves)
        return 3 * (free // 3) + 1 if self.basis == "bezier" else free


def write(folder: Path, drawn: Drawn, still: bool = False) -> Path:
    """Writes the character into `folder`; returns its shot. `still`: nothing moves."""
    write_groom(folder / "groom.usd", drawn)
    write_character(folder / "char.usd")
    write_shot(folder / "shot.usda", still)
    return folder / "shot.usda"


def new_stage(path: Path, root: str, schema: Any = UsdGeom.Xform) -> Usd.Stage:
    """An empty stage with a default prim."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.SetFramesPerSecond(24)
    stage.SetTimeCodesPerSecond(24)
    stage.SetDefaultPrim(schema.Define(stage, root).GetPrim())
    return stage


def write_groom(path: Path, drawn: Drawn) -> None:
    """The groom: two variants of hair, and guides."""
    stage = new_stage(path, "/groom")
    looks = [
        look(stage, name, colour) for name, colour in (("hair", (0.6, 0.02, 0.02)), ("fringe", (0, 0, 0.6)))
    ]
    variants = stage.GetDefaultPrim().GetVariantSets().AddVariantSet("density")
    for name, count in VARIANTS.items():
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            hair, front = add_hair(stage, "/groom/scalp_hair", count, drawn, 1)
            hair.CreatePurposeAttr("render")
            bind(hair, looks[0])
            fringe = UsdGeom.Subset.Define(stage, "/groom/scalp_hair/fringe")
            fringe.CreateElementTypeAttr("face")
            fringe.CreateIndicesAttr(np.flatnonzero(front).tolist())
            fringe.CreateFamilyNameAttr("materialBind")
            bind(fringe, looks[1])
    variants.SetVariantSelection("hi")
    guides, _ = add_hair(stage, "/groom/sim_guides", 80, drawn, 7)
    guides.CreatePurposeAttr("proxy")
    bind(guides, looks[0])
    stage.Save()


def look(stage: Usd.Stage, name: str, colour: tuple[float, float, float]) -> UsdShade.Material:
    """A material of one colour."""
    material = UsdShade.Material.Define(stage, f"/groom/look/{name}")
    surface = UsdShade.Shader.Define(stage, f"/groom/look/{name}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", TYPES.Color3f).Set(Gf.Vec3f(*colour))
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", TYPES.Token))
    return material


def bind(schema: Any, material: UsdShade.Material) -> None:
    """Binds a material to a prim."""
    UsdShade.MaterialBindingAPI.Apply(schema.GetPrim()).Bind(material)


def add_hair(
    stage: Usd.Stage, path: str, count: int, drawn: Drawn, seed: int
) -> tuple[UsdGeom.BasisCurves, BoolArray]:
    """Wavy hair on the upper part of the head, and whether each curve is in front."""
    random = np.random.default_rng(seed)
    around, down = random.uniform(0, 2 * np.pi, count), np.arccos(random.uniform(0.25, 1, count))
    out = np.stack([np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down)], axis=1)
    counts, points = drawn.counts(random, count), []
    for direction, n in zip(out, counts, strict=True):
        length, t = random.uniform(14, 24), np.linspace(0, 1, n)[:, None]
        line = [0, 0, 170] + direction * HEAD + t * direction * length * 0.35 - t**2 * [0, 0, 0.8 * length]
        wave = np.sin(9 * t) * t * random.normal(size=3) * 0.4
        if drawn.wrap == "nonperiodic" and drawn.basis in ("bspline", "catmullRom"):
            # These curves start at their second point, or nearly.
            line = np.vstack([2 * line[:1] - line[1:2], line[:-1]])
        points.append(line + wave)
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreateTypeAttr("linear" if drawn.basis == "linear" else "cubic")
    curves.CreateBasisAttr("bspline" if drawn.basis == "linear" else drawn.basis)
    curves.CreateWrapAttr(drawn.wrap)
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.concatenate(points).astype(np.float32)))
    curves.CreateCurveVertexCountsAttr(counts.tolist())
    curves.CreateWidthsAttr([w for n in counts for w in np.linspace(0.02, 0.004, n).tolist()])
    curves.SetWidthsInterpolation("vertex")
    primvars = UsdGeom.PrimvarsAPI(curves)
    primvars.CreatePrimvar("hair_id", TYPES.IntArray, "uniform").Set(list(range(1000, 1000 + count)))
    primvars.CreatePrimvar("melanin", TYPES.FloatArray, "uniform").Set(random.uniform(0, 1, count).tolist())
    roots = [Gf.Vec2f(float(u), float(v)) for u, v in zip(around / (2 * np.pi), down / np.pi, strict=True)]
    primvars.CreatePrimvar("st", TYPES.TexCoord2fArray, "uniform").Set(roots)
    primvars.CreatePrimvar("displayColor", TYPES.Color3fArray, "constant").Set([Gf.Vec3f(0.3, 0.1, 0.05)])
    return curves, out[:, 1] < -0.5


def ellipsoid(
    centre: float, axes: FloatArray, rings: int = 16, sides: int = 24
) -> tuple[FloatArray, list[int]]:
    """Vertices and corners of quads."""
    polar, turn = np.meshgrid(
        np.pi * np.arange(rings + 1) / rings, 2 * np.pi * np.arange(sides) / sides, indexing="ij"
    )
    sphere = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=-1)
    corners = [
        i
        for ring in range(rings)
        for side in range(sides)
        for i in (
            ring * sides + side,
            (ring + 1) * sides + side,
            (ring + 1) * sides + (side + 1) % sides,
            ring * sides + (side + 1) % sides,
        )
    ]
    return sphere.reshape(-1, 3) * axes + [0, 0, centre], corners


def write_character(path: Path) -> None:
    """Skeleton, skinned body, and the groom behind a payload."""
    stage = new_stage(path, "/char", UsdSkel.Root)

    def lift(height: float) -> Gf.Matrix4d:
        return Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0, height))

    rig = UsdSkel.Skeleton.Define(stage, "/char/rig")
    rig.CreateJointsAttr(JOINTS)
    rig.CreateBindTransformsAttr([lift(0), lift(100), lift(160)])
    rig.CreateRestTransformsAttr([lift(0), lift(100), lift(60)])
    head, corners = ellipsoid(170, HEAD)
    torso, others = ellipsoid(120, np.array([20.0, 14.0, 40.0]))
    points = np.concatenate([head, torso])
    corners += [i + len(head) for i in others]
    body = UsdGeom.Mesh.Define(stage, "/char/geo/body")
    body.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    body.CreateFaceVertexCountsAttr([4] * (len(corners) // 4))
    body.CreateFaceVertexIndicesAttr(corners)
    body.CreateSubdivisionSchemeAttr("none")
    binding = UsdSkel.BindingAPI.Apply(body.GetPrim())
    binding.CreateSkeletonRel().SetTargets(["/char/rig"])
    weight = np.clip((points[:, 2] - 130) / 25, 0, 1)
    binding.CreateJointIndicesPrimvar(False, 2).Set([1, 2] * len(points))
    binding.CreateJointWeightsPrimvar(False, 2).Set(np.stack([1 - weight, weight], axis=1).ravel().tolist())
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1))
    stage.DefinePrim("/char/hairgroom", "Xform").GetPayloads().AddPayload("./groom.usd")
    stage.Save()


def write_shot(path: Path, still: bool) -> None:
    """The character, placed and turned as it walks, with a head that shakes; and an instance of it."""
    stage = new_stage(path, "/world")
    stage.SetStartTimeCode(FIRST)
    stage.SetEndTimeCode(LAST)
    hero = UsdGeom.Xform.Define(stage, "/world/hero")
    walk, turn = hero.AddTranslateOp(), hero.AddRotateZOp()
    stage.DefinePrim(CHARACTER).GetReferences().AddReference("./char.usd")
    motion = UsdSkel.Animation.Define(stage, "/world/hero/anim")
    motion.CreateJointsAttr(JOINTS)
    motion.CreateTranslationsAttr([Gf.Vec3f(0, 0, z) for z in (0, 100, 60)])
    motion.CreateScalesAttr([Gf.Vec3h(1, 1, 1)] * 3)
    turns = motion.CreateRotationsAttr()

    def about(axis: int, degrees: float) -> Gf.Quatf:
        half = np.radians(degrees) / 2
        imaginary = [0.0, 0.0, 0.0]
        imaginary[axis] = float(np.sin(half))
        return Gf.Quatf(float(np.cos(half)), *imaginary)

    for frame in range(FIRST - RUN_UP, LAST + RUN_UP):
        time = 0.0 if still else max(0, frame - FIRST) / 24
        walk.Set(Gf.Vec3d(200 + 60 * time, 50, 0), frame)
        turn.Set(30 + 40 * time, frame)
        shake, bow = 45 * np.sin(3 * np.pi * time), 8 * np.sin(2 * np.pi * time)
        turns.Set([Gf.Quatf(1, 0, 0, 0), about(0, bow), about(2, shake)], frame)
    rig = UsdSkel.BindingAPI.Apply(stage.OverridePrim(f"{CHARACTER}/rig"))
    rig.CreateAnimationSourceRel().SetTargets(["/world/hero/anim"])
    UsdGeom.Xform.Define(stage, "/world/extra").AddTranslateOp().Set(Gf.Vec3d(-200, 0, 0))
    extra = stage.DefinePrim("/world/extra/char")
    extra.GetReferences().AddReference("./char.usd")
    extra.SetInstanceable(True)
    stage.Save()
