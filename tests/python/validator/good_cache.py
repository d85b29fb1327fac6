"""A small cache that passes every check, written by Pixar's USD to test the validator on its own."""

import hashlib
import json
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade, Vt

from hairbake_validate.geometry import Array, FloatArray, IntArray

FIRST, LAST, FPS = 1001, 1006, 24.0
HANDLES = range(FIRST - 1, LAST + 2)
"""The frames, and a handle frame at each end."""
CURVES, POINTS, GUIDE_COUNT = 12, 8, 3
RADIUS, LENGTH = 0.1, 0.2
"""Radius of the skull and length of the strands, m."""
SAMPLES, SHUTTER = 3, 0.5
HAIR, GUIDES, SKULL, HEAD = "/groom/hair", "/groom/guides", "/groom/colliders/skull", "/groom/head"
MATERIAL = "/groom/materials/hair"


def head_matrix(time: float) -> NDArray[np.float64]:
    """Rest space to world at `time` seconds, for row vectors: a shake about Y with a little travel."""
    angle = 0.6 * np.sin(2 * np.pi * 1.5 * time)
    matrix = np.eye(4)
    matrix[:3, :3] = [[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]]
    matrix[3, :3] = [0.05 * np.sin(4 * time), 1.6, 0.2 * time]
    return matrix


def rest_points(curves: int) -> FloatArray:
    """Gently bent strands of length LENGTH that leave a sphere about the origin; `curves × POINTS × 3`."""
    index = np.arange(curves)
    azimuth, height = 2.4 * index, 0.2 + 0.6 * (index + 0.5) / curves
    flat = np.sqrt(1 - height**2)
    out = np.stack([flat * np.cos(azimuth), height, flat * np.sin(azimuth)], axis=1)
    side = np.stack([-np.sin(azimuth), np.zeros(curves), np.cos(azimuth)], axis=1)
    return circular_arcs(out, side, bend=np.full(curves, 0.8))


def circular_arcs(out: FloatArray, side: FloatArray, bend: FloatArray) -> FloatArray:
    """Arcs of length LENGTH that leave the sphere along `out` and turn by `bend` radians towards `side`."""
    angle = bend[:, None] * np.linspace(0, 1, POINTS)
    along = LENGTH / bend[:, None] * np.sin(angle)
    across = LENGTH / bend[:, None] * (1 - np.cos(angle))
    arcs: FloatArray = (
        1.02 * RADIUS * out[:, None] + along[..., None] * out[:, None] + across[..., None] * side[:, None]
    )
    return arcs


def declare(stage: Usd.Stage, metres_per_unit: float, up_axis: str) -> None:
    """Declares unit, axis, rate and frames of a stage."""
    UsdGeom.SetStageMetersPerUnit(stage, metres_per_unit)
    UsdGeom.SetStageUpAxis(stage, up_axis)
    stage.SetTimeCodesPerSecond(FPS)
    stage.SetFramesPerSecond(FPS)
    stage.SetStartTimeCode(FIRST)
    stage.SetEndTimeCode(LAST)


def transform(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """Points under a matrix for row vectors; not the validator's own function, so that it is tested."""
    moved: FloatArray = points @ matrix[:3, :3] + matrix[3, :3]
    return moved


def sphere_mesh() -> tuple[FloatArray, IntArray]:
    """Vertices and triangles of a closed sphere with outward normals."""
    rings, sectors = 8, 12
    polar = np.pi * np.arange(1, rings) / rings
    turn = 2 * np.pi * np.arange(sectors) / sectors
    ring = np.stack(
        [
            np.outer(np.sin(polar), np.cos(turn)),
            np.outer(np.cos(polar), np.ones(sectors)),
            np.outer(np.sin(polar), np.sin(turn)),
        ],
        axis=-1,
    )
    points = RADIUS * np.concatenate([[[0, 1, 0]], ring.reshape(-1, 3), [[0, -1, 0]]])
    last = len(points) - 1
    triangles: list[list[int]] = []
    for j in range(sectors):
        k = (j + 1) % sectors
        triangles.append([0, 1 + k, 1 + j])
        triangles.append([last, last - sectors + j, last - sectors + k])
        for i in range(rings - 2):
            a, b = 1 + i * sectors + j, 1 + i * sectors + k
            triangles += [[a, b, b + sectors], [a, b + sectors, a + sectors]]
    return points, np.array(triangles)


FIGURES = {"contacts": 3, "exempt_segments": 4, "contact_segments": 100}
"""Figures of every frame."""


class CacheBuilder:
    """Writes the good cache into a folder, and applies changes to it."""

    def __init__(self, directory: Path, copy_of: Path | None = None) -> None:
        """Writes a cache into `directory`, or copies one."""
        self.directory = directory
        self.counts = {HAIR: CURVES, GUIDES: GUIDE_COUNT}
        """Number of curves by prim."""
        if copy_of is not None:
            shutil.copytree(copy_of, directory)
            return
        directory.mkdir(parents=True)
        # A bake leaves the folder from which it can resume.
        (directory / ".hairbake").mkdir()
        self._write_topology()
        self._write_manifest()
        self._write_root()
        for frame in HANDLES:
            self._write_frame(frame)
        self.seal()

    def path(self, name: str) -> Path:
        return self.directory / name

    def frame(self, frame: int) -> Path:
        return self.path(f"hair.{frame}.usdc")

    def seal(self) -> None:
        """Writes manifest.json with the checksums of the files as they are."""
        names = ["hair.usda", "hair.topology.usdc", "hair.manifest.usda"]
        record = {
            "format": "hairbake-cache",
            "version": 1,
            "hairbake": "0.1.0",
            "inputs": [{"role": "groom", "file": "groom.json", "sha256": "0" * 64}],
            "settings": {"samples": SAMPLES, "shutter": SHUTTER},
            "layers": [self.file_record(self.path(name)) for name in names],
            "frames": [
                {"frame": frame, **self.file_record(self.frame(frame)), "figures": FIGURES}
                for frame in HANDLES
            ],
        }
        self.path("manifest.json").write_text(json.dumps(record, indent=2))

    def edit_record(self, change: Callable[[dict[str, Any]], Any]) -> None:
        """Rewrites manifest.json after `change(record)`."""
        record = json.loads(self.path("manifest.json").read_text())
        change(record)
        self.path("manifest.json").write_text(json.dumps(record))

    def edit(self, name: str, change: Callable[[Sdf.Layer], Any]) -> None:
        """Applies `change(layer)` to one file and updates the checksums."""
        layer = Sdf.Layer.OpenAsAnonymous(str(self.path(name)))
        change(layer)
        layer.Export(str(self.path(name)))
        self.seal()

    def edit_topology(self, change: Callable[[Usd.Stage], Any]) -> None:
        """Applies `change(stage)` to the topology layer and updates the checksums."""
        self.edit("hair.topology.usdc", lambda layer: change(Usd.Stage.Open(layer)))

    def edit_frame(self, frame: int, change: Callable[[Sdf.Layer], Any]) -> None:
        """Applies `change(layer)` to one frame's file and updates the checksums."""
        self.edit(self.frame(frame).name, change)

    def edit_array(self, frame: int, path: str, change: Callable[[Array], Array], after: float = 0.0) -> None:
        """Replaces one array of one frame's file, at the frame or `after` it, by `change(array)`."""

        def rewrite(layer: Sdf.Layer) -> None:
            value = layer.QueryTimeSample(path, frame + after)
            changed = change(np.array(value))
            layer.SetTimeSample(path, frame + after, type(value).FromNumpy(np.ascontiguousarray(changed)))

        self.edit_frame(frame, rewrite)

    def add_attribute(
        self,
        path: str,
        kind: Sdf.ValueTypeName,
        sample: Callable[[Sdf.Layer, int, float], Any],
    ) -> None:
        """Adds an animated attribute to the clip manifest and to every frame.

        Its values are `sample(layer, frame, time)`, at the times of the guides' points.
        """

        def declare(layer: Sdf.Layer) -> None:
            prim = Sdf.CreatePrimInLayer(layer, Sdf.Path(path).GetPrimPath())
            Sdf.AttributeSpec(prim, Sdf.Path(path).name, kind)

        def put(layer: Sdf.Layer, frame: int) -> None:
            declare(layer)
            for time in layer.ListTimeSamplesForPath(f"{GUIDES}.points"):
                layer.SetTimeSample(path, time, sample(layer, frame, time))

        self.edit("hair.manifest.usda", declare)
        for frame in HANDLES:
            self.edit_frame(frame, partial(put, frame=frame))

    @staticmethod
    def file_record(path: Path) -> dict[str, Any]:
        """What manifest.json holds of a file."""
        data = path.read_bytes() if path.exists() else b""
        return {"file": path.name, "sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}

    def _write_topology(self) -> None:
        stage = Usd.Stage.CreateNew(str(self.path("hair.topology.usdc")))
        groom = UsdGeom.Xform.Define(stage, "/groom")
        Usd.ModelAPI(groom).SetKind(Kind.Tokens.component)
        stage.SetDefaultPrim(groom.GetPrim())
        UsdGeom.Xform.Define(stage, HEAD).AddTransformOp()
        material = UsdShade.Material.Define(stage, MATERIAL)
        surface = UsdShade.Shader.Define(stage, f"{MATERIAL}/surface")
        surface.CreateIdAttr("UsdPreviewSurface")
        material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
        for path, count in self.counts.items():
            self._define_curves(stage, path, count)
            UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath(path)).Bind(material)
        self._define_skull(stage)
        stage.Save()

    def _define_skull(self, stage: Usd.Stage) -> None:
        UsdGeom.Scope.Define(stage, "/groom/colliders")
        mesh = UsdGeom.Mesh.Define(stage, SKULL)
        mesh.AddTransformOp()
        points, triangles = sphere_mesh()
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
        mesh.CreateExtentAttr(Vt.Vec3fArray([Gf.Vec3f(-RADIUS), Gf.Vec3f(RADIUS)]))
        mesh.CreateFaceVertexCountsAttr([3] * len(triangles))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel().astype(np.int32)))
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.CreatePurposeAttr("guide")

    def _define_curves(self, stage: Usd.Stage, path: str, count: int) -> None:
        curves = UsdGeom.BasisCurves.Define(stage, path)
        curves.CreateTypeAttr("cubic")
        curves.CreateWrapAttr("pinned")
        curves.CreateBasisAttr("catmullRom")
        curves.CreateCurveVertexCountsAttr([POINTS] * count)
        curves.CreateWidthsAttr(Vt.FloatArray([8e-5] * (POINTS * count)))
        curves.SetWidthsInterpolation("vertex")
        if path == GUIDES:
            curves.CreatePurposeAttr("guide")
        primvars = UsdGeom.PrimvarsAPI(curves)
        types = Sdf.ValueTypeNames
        uniform = {
            "groom_id": (types.IntArray, list(range(count))),
            "groom_group_id": (types.IntArray, [0] * count),
            "groom_group_name": (types.StringArray, ["hair"] * count),
            "groom_guide": (types.IntArray, [int(path == GUIDES)] * count),
            "groom_root_uv": (types.TexCoord2fArray, [Gf.Vec2f(0.5, i / count) for i in range(count)]),
        }
        for name, (kind, values) in uniform.items():
            primvars.CreatePrimvar(name, kind, "uniform").Set(values)
        if path == HAIR:
            closest = primvars.CreatePrimvar("groom_closest_guides", types.IntArray, "uniform", 3)
            closest.Set([guide for i in range(count) for guide in (i % GUIDE_COUNT, 0, 0)])
            weights = primvars.CreatePrimvar("groom_guide_weights", types.FloatArray, "uniform", 3)
            weights.Set([1.0, 0.0, 0.0] * count)
        rest = rest_points(count).reshape(-1, 3).astype(np.float32)
        if path == GUIDES:
            arc = primvars.CreatePrimvar("groom_arc", types.FloatArray, "vertex")
            arc.Set(
                Vt.FloatArray.FromNumpy(np.tile(LENGTH * np.linspace(0, 1, POINTS), count).astype(np.float32))
            )
        primvars.CreatePrimvar("rest", types.Point3fArray, "vertex").Set(Vt.Vec3fArray.FromNumpy(rest))

    def _write_manifest(self) -> None:
        layer = Sdf.Layer.CreateNew(str(self.path("hair.manifest.usda")))
        self._declare_animated(layer)
        layer.Save()

    def _declare_animated(self, layer: Sdf.Layer) -> None:
        types = Sdf.ValueTypeNames
        kinds = {f"{path}.xformOp:transform": types.Matrix4d for path in (HEAD, SKULL)}
        for path in self.counts:
            kinds[f"{path}.points"] = types.Point3fArray
            kinds[f"{path}.velocities"] = types.Vector3fArray
            kinds[f"{path}.extent"] = types.Float3Array
        for path, kind in kinds.items():
            prim = Sdf.CreatePrimInLayer(layer, Sdf.Path(path).GetPrimPath())
            Sdf.AttributeSpec(prim, Sdf.Path(path).name, kind)

    def _write_root(self) -> None:
        layer = Sdf.Layer.CreateNew(str(self.path("hair.usda")))
        layer.subLayerPaths = ["./hair.topology.usdc"]
        stage = Usd.Stage.Open(layer)
        declare(stage, 1.0, "Y")
        layer.defaultPrim = "groom"
        clips = Usd.ClipsAPI(stage.OverridePrim("/groom"))
        clips.SetClipTemplateAssetPath("./hair.####.usdc")
        clips.SetClipTemplateStartTime(FIRST - 1)
        clips.SetClipTemplateEndTime(LAST + 1)
        clips.SetClipTemplateStride(1)
        clips.SetClipPrimPath("/groom")
        clips.SetClipManifestAssetPath("./hair.manifest.usda")
        layer.Save()

    def _write_frame(self, frame: int) -> None:
        layer = Sdf.Layer.CreateNew(str(self.frame(frame)))
        self._declare_animated(layer)
        for i in range(SAMPLES):
            self._write_sample(layer, frame + SHUTTER * i / (SAMPLES - 1))
        layer.Save()

    def _write_sample(self, layer: Sdf.Layer, at: float) -> None:
        time, step = (at - FIRST) / FPS, 1e-4
        for path, count in self.counts.items():
            rest = rest_points(count).reshape(-1, 3)
            now, before, after = (transform(rest, head_matrix(t)) for t in (time, time - step, time + step))
            points = now.astype(np.float32)
            values = {
                "points": points,
                "velocities": ((after - before) / (2 * step)).astype(np.float32),
                "extent": np.stack([points.min(0) - 4e-5, points.max(0) + 4e-5]),
            }
            for name, value in values.items():
                layer.SetTimeSample(f"{path}.{name}", at, Vt.Vec3fArray.FromNumpy(value))
        for path in (HEAD, SKULL):
            matrix = Gf.Matrix4d(*head_matrix(time).ravel().tolist())
            layer.SetTimeSample(f"{path}.xformOp:transform", at, matrix)
