"""A small good cache, written by Pixar's USD and not by hairbake, so that the validator is tested on its own."""

import hashlib
import json
from pathlib import Path

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade, Vt

FIRST, LAST, FPS = 1001, 1006, 24.0
HANDLES = range(FIRST - 1, LAST + 2)
CURVES, POINTS, GUIDE_COUNT = 12, 8, 3
RADIUS, LENGTH = 0.1, 0.2
SAMPLES, SHUTTER = 3, 0.5


def head_matrix(time: float) -> np.ndarray:
    """Rest space to world at `time` seconds, for row vectors: a shake about Y with a little travel."""
    angle = 0.6 * np.sin(2 * np.pi * 1.5 * time)
    matrix = np.eye(4)
    matrix[:3, :3] = [[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]]
    matrix[3, :3] = [0.05 * np.sin(4 * time), 1.6, 0.2 * time]
    return matrix


def rest_points(curves: int) -> np.ndarray:
    """Gently bent inextensible strands that stand off a sphere about the origin; `curves × POINTS × 3`."""
    index = np.arange(curves)
    azimuth, height = 2.4 * index, 0.2 + 0.6 * (index + 0.5) / curves
    flat = np.sqrt(1 - height**2)
    out = np.stack([flat * np.cos(azimuth), height, flat * np.sin(azimuth)], axis=1)
    side = np.stack([-np.sin(azimuth), np.zeros(curves), np.cos(azimuth)], axis=1)
    return strands(out, side, bend=np.full(curves, 0.8))


def strands(out: np.ndarray, side: np.ndarray, bend: np.ndarray) -> np.ndarray:
    """Circular arcs of length LENGTH that leave the sphere along `out` and turn by `bend` radians to `side`."""
    angle = bend[:, None] * np.linspace(0, 1, POINTS)
    along = LENGTH / bend[:, None] * np.sin(angle)
    across = LENGTH / bend[:, None] * (1 - np.cos(angle))
    return 1.02 * RADIUS * out[:, None] + along[..., None] * out[:, None] + across[..., None] * side[:, None]


def transform(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    return points @ matrix[:3, :3] + matrix[3, :3]


def sphere_mesh() -> tuple[np.ndarray, np.ndarray]:
    """A closed sphere of triangles, wound so that its normals point outwards."""
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
    last, triangles = len(points) - 1, []
    for j in range(sectors):
        k = (j + 1) % sectors
        triangles.append([0, 1 + k, 1 + j])
        triangles.append([last, last - sectors + j, last - sectors + k])
        for i in range(rings - 2):
            a, b = 1 + i * sectors + j, 1 + i * sectors + k
            triangles += [[a, b, b + sectors], [a, b + sectors, a + sectors]]
    return points, np.array(triangles)


class CacheBuilder:
    """Writes the good cache into a folder, and what the tests then do to it."""

    def __init__(self, directory: Path):
        self.directory = directory
        directory.mkdir(parents=True, exist_ok=True)
        # As a bake leaves it: with what it needs to go on.
        (directory / ".hairbake").mkdir(exist_ok=True)
        self.counts = {"/groom/hair": CURVES, "/groom/guides": GUIDE_COUNT}
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
            "layers": [self._file_record(self.path(name)) for name in names],
            "frames": [
                {"frame": frame, **self._file_record(self.frame(frame)), "figures": {"contacts": 3}}
                for frame in HANDLES
            ],
        }
        self.path("manifest.json").write_text(json.dumps(record, indent=2))

    def record(self, change) -> None:
        """Rewrites manifest.json after `change(record)`."""
        record = json.loads(self.path("manifest.json").read_text())
        change(record)
        self.path("manifest.json").write_text(json.dumps(record))

    def edit(self, name: str, change) -> None:
        """Applies `change(layer)` to one file and renews the checksums."""
        layer = Sdf.Layer.OpenAsAnonymous(str(self.path(name)))
        change(layer)
        layer.Export(str(self.path(name)))
        self.seal()

    def edit_topology(self, change) -> None:
        """Applies `change(stage)` to the topology layer and renews the checksums."""
        self.edit("hair.topology.usdc", lambda layer: change(Usd.Stage.Open(layer)))

    def edit_array(self, frame: int, path: str, change, after: float = 0.0) -> None:
        """Replaces one attribute's array in one frame's file, at the frame or `after` it, by `change(array)`."""

        def rewrite(layer):
            value = layer.QueryTimeSample(path, frame + after)
            changed = change(np.array(value))
            layer.SetTimeSample(path, frame + after, type(value).FromNumpy(np.ascontiguousarray(changed)))

        self.edit(self.frame(frame).name, rewrite)

    @staticmethod
    def _file_record(path: Path) -> dict:
        data = path.read_bytes() if path.exists() else b""
        return {"file": path.name, "sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}

    def _write_topology(self) -> None:
        stage = Usd.Stage.CreateNew(str(self.path("hair.topology.usdc")))
        groom = UsdGeom.Xform.Define(stage, "/groom")
        Usd.ModelAPI(groom).SetKind(Kind.Tokens.component)
        stage.SetDefaultPrim(groom.GetPrim())
        head = UsdGeom.Xform.Define(stage, "/groom/head")
        head.AddTransformOp()
        material = UsdShade.Material.Define(stage, "/groom/materials/hair")
        surface = UsdShade.Shader.Define(stage, "/groom/materials/hair/surface")
        surface.CreateIdAttr("UsdPreviewSurface")
        material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
        for path, curves in self.counts.items():
            self._define_curves(stage, path, curves)
            UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath(path)).Bind(material)
        UsdGeom.Scope.Define(stage, "/groom/colliders")
        mesh = UsdGeom.Mesh.Define(stage, "/groom/colliders/skull")
        mesh.AddTransformOp()
        points, triangles = sphere_mesh()
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
        mesh.CreateExtentAttr(Vt.Vec3fArray([Gf.Vec3f(-RADIUS), Gf.Vec3f(RADIUS)]))
        mesh.CreateFaceVertexCountsAttr([3] * len(triangles))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel().astype(np.int32)))
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.CreatePurposeAttr("guide")
        stage.Save()

    def _define_curves(self, stage: Usd.Stage, path: str, count: int) -> None:
        curves = UsdGeom.BasisCurves.Define(stage, path)
        curves.CreateTypeAttr("cubic")
        curves.CreateWrapAttr("pinned")
        curves.CreateBasisAttr("catmullRom")
        curves.CreateCurveVertexCountsAttr([POINTS] * count)
        curves.CreateWidthsAttr(Vt.FloatArray([8e-5] * (POINTS * count)))
        curves.SetWidthsInterpolation("vertex")
        if path.endswith("guides"):
            curves.CreatePurposeAttr("guide")
        primvars = UsdGeom.PrimvarsAPI(curves)
        types, uniform = Sdf.ValueTypeNames, "uniform"
        primvars.CreatePrimvar("groom_id", types.IntArray, uniform).Set(list(range(count)))
        primvars.CreatePrimvar("groom_group_id", types.IntArray, uniform).Set([0] * count)
        primvars.CreatePrimvar("groom_group_name", types.StringArray, uniform).Set(["hair"] * count)
        primvars.CreatePrimvar("groom_guide", types.IntArray, uniform).Set(
            [int(path.endswith("guides"))] * count
        )
        primvars.CreatePrimvar("groom_root_uv", types.TexCoord2fArray, uniform).Set(
            [Gf.Vec2f(0.5, i / count) for i in range(count)]
        )
        if not path.endswith("guides"):
            closest = primvars.CreatePrimvar("groom_closest_guides", types.IntArray, uniform, 3)
            closest.Set([g for i in range(count) for g in (i % GUIDE_COUNT, 0, 0)])
            weights = primvars.CreatePrimvar("groom_guide_weights", types.FloatArray, uniform, 3)
            weights.Set([1.0, 0.0, 0.0] * count)
        rest = rest_points(count).reshape(-1, 3).astype(np.float32)
        primvars.CreatePrimvar("rest", types.Point3fArray, "vertex").Set(Vt.Vec3fArray.FromNumpy(rest))

    def _write_manifest(self) -> None:
        layer = Sdf.Layer.CreateNew(str(self.path("hair.manifest.usda")))
        for path, type_name in self._animated().items():
            prim = Sdf.CreatePrimInLayer(layer, Sdf.Path(path).GetPrimPath())
            Sdf.AttributeSpec(prim, Sdf.Path(path).name, type_name)
        layer.Save()

    def _animated(self) -> dict[str, Sdf.ValueTypeName]:
        types = Sdf.ValueTypeNames
        paths = {}
        for path in self.counts:
            paths |= {
                f"{path}.points": types.Point3fArray,
                f"{path}.velocities": types.Vector3fArray,
                f"{path}.extent": types.Float3Array,
            }
        return paths | {
            f"{path}.xformOp:transform": types.Matrix4d for path in ("/groom/head", "/groom/colliders/skull")
        }

    def _write_root(self) -> None:
        layer = Sdf.Layer.CreateNew(str(self.path("hair.usda")))
        layer.subLayerPaths = ["./hair.topology.usdc"]
        stage = Usd.Stage.Open(layer)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        UsdGeom.SetStageUpAxis(stage, "Y")
        stage.SetTimeCodesPerSecond(FPS)
        stage.SetFramesPerSecond(FPS)
        stage.SetStartTimeCode(FIRST)
        stage.SetEndTimeCode(LAST)
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
        for path, type_name in self._animated().items():
            prim = Sdf.CreatePrimInLayer(layer, Sdf.Path(path).GetPrimPath())
            Sdf.AttributeSpec(prim, Sdf.Path(path).name, type_name)
        for i in range(SAMPLES):
            self._write_moment(layer, frame + SHUTTER * i / (SAMPLES - 1))
        layer.Save()

    def _write_moment(self, layer: Sdf.Layer, at: float) -> None:
        time, step = (at - FIRST) / FPS, 1e-4

        def put(path: str, value) -> None:
            layer.SetTimeSample(path, at, value)

        for path, count in self.counts.items():
            rest = rest_points(count)
            points, before, after = (
                transform(rest, head_matrix(t)) for t in (time, time - step, time + step)
            )
            points = points.reshape(-1, 3).astype(np.float32)
            velocities = ((after - before) / (2 * step)).reshape(-1, 3).astype(np.float32)
            put(f"{path}.points", Vt.Vec3fArray.FromNumpy(points))
            put(f"{path}.velocities", Vt.Vec3fArray.FromNumpy(velocities))
            put(
                f"{path}.extent",
                Vt.Vec3fArray.FromNumpy(np.stack([points.min(0) - 4e-5, points.max(0) + 4e-5])),
            )
        for path in ("/groom/head", "/groom/colliders/skull"):
            put(f"{path}.xformOp:transform", Gf.Matrix4d(*head_matrix(time).ravel().tolist()))
