"""A character from a binary glTF file as a UsdSkel stage: the data are copied, and pxr skins them."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from hairbake_validate.geometry import Array, FloatArray

TYPES = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
FPS = 24.0


class Character:
    """A skinned mesh with one animation."""

    def __init__(self, path: Path) -> None:
        """Reads the first mesh, skin and animation of a .glb file."""
        data = path.read_bytes()
        length = struct.unpack("<I", data[12:16])[0]
        self.json: dict[str, Any] = json.loads(data[20 : 20 + length])
        self.binary = data[20 + length + 8 :]
        primitive = self.json["meshes"][0]["primitives"][0]
        attributes = primitive["attributes"]
        self.points: FloatArray = self.accessor(attributes["POSITION"])
        self.triangles = self.accessor(primitive["indices"]).reshape(-1, 3).astype(int)
        self.joints_of = self.accessor(attributes["JOINTS_0"]).astype(int)
        self.weights: FloatArray = self.accessor(attributes["WEIGHTS_0"]).astype(float)
        self.weights /= self.weights.sum(axis=1, keepdims=True)
        skin = self.json["skins"][0]
        self.joints: list[int] = skin["joints"]
        matrices = self.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
        self.inverse: FloatArray = matrices.transpose(0, 2, 1).astype(float)
        self.parent = {child: i for i, node in enumerate(self.nodes) for child in node.get("children", ())}
        animation = self.json["animations"][0]
        self.channels: dict[tuple[int, str], tuple[FloatArray, FloatArray]] = {}
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            times, values = (self.accessor(sampler[name]).astype(float) for name in ("input", "output"))
            self.channels[channel["target"]["node"], channel["target"]["path"]] = times.reshape(-1), values

    @property
    def nodes(self) -> list[dict[str, Any]]:
        """The nodes."""
        nodes: list[dict[str, Any]] = self.json["nodes"]
        return nodes

    def accessor(self, index: int) -> Array:
        """The numbers of an accessor, one row each."""
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, width = np.dtype(TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        shape, strides = (accessor["count"], width), (stride, kind.itemsize)
        return np.array(np.ndarray(shape, kind, self.binary, start, strides))

    def local(self, node: int, time: float | None) -> FloatArray:
        """Matrix of a node to its parent, for column vectors, at a time, or at rest."""
        entry = self.nodes[node]
        if "matrix" in entry:
            return np.array(entry["matrix"], float).reshape(4, 4).T
        defaults = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}
        parts = {}
        for name, default in defaults.items():
            parts[name] = np.array(entry.get(name, default), float)
            if time is not None and (node, name) in self.channels:
                times, values = self.channels[node, name]
                k = int(np.clip(np.searchsorted(times, time + 1e-9) - 1, 0, len(times) - 2))
                u = float(np.clip((time - times[k]) / (times[k + 1] - times[k]), 0, 1))
                first, second = values[k], values[k + 1]
                second = -second if name == "rotation" and first @ second < 0 else second
                parts[name] = first + u * (second - first)
        x, y, z, w = parts["rotation"] / np.linalg.norm(parts["rotation"])
        matrix = np.eye(4)
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        matrix[:3, :3] *= parts["scale"]
        matrix[:3, 3] = parts["translation"]
        return matrix

    def world(self, node: int, time: float | None) -> FloatArray:
        """Matrix of a node to the world."""
        matrix = self.local(node, time)
        while node in self.parent:
            node = self.parent[node]
            matrix = self.local(node, time) @ matrix
        return matrix

    def at_rest(self) -> FloatArray:
        """Its vertices with all nodes at rest, m."""
        to_world = np.array([self.world(joint, None) for joint in self.joints]) @ self.inverse
        blended = np.einsum("vj,vjab->vab", self.weights, to_world[self.joints_of])
        points: FloatArray = np.einsum("vab,vb->va", blended, np.c_[self.points, np.ones(len(self.points))])[
            :, :3
        ]
        return points

    def start(self) -> float:
        """Time of the first key, s."""
        return float(min(times.min() for times, _ in self.channels.values()))

    def write(self, path: Path, frames: range) -> None:
        """Writes a stage whose frame `frames[0]` is the first key: bound where all nodes are at rest."""
        stage = Usd.Stage.CreateNew(str(path))
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        stage.SetTimeCodesPerSecond(FPS)
        stage.SetStartTimeCode(frames[0])
        stage.SetEndTimeCode(frames[-1])
        root = UsdSkel.Root.Define(stage, "/man")
        stage.SetDefaultPrim(root.GetPrim())
        names = [f"j{i}" for i in range(len(self.joints))]
        skeleton = UsdSkel.Skeleton.Define(stage, "/man/rig")
        skeleton.CreateJointsAttr(names)
        rest = [gf(self.world(joint, None)) for joint in self.joints]
        skeleton.CreateBindTransformsAttr(rest)
        skeleton.CreateRestTransformsAttr(rest)
        animation = UsdSkel.Animation.Define(stage, "/man/walk")
        animation.CreateJointsAttr(names)
        attributes = (
            animation.CreateTranslationsAttr(),
            animation.CreateRotationsAttr(),
            animation.CreateScalesAttr(),
        )
        for frame in frames:
            time = self.start() + (frame - frames[0]) / FPS
            matrices = Vt.Matrix4dArray([gf(self.world(joint, time)) for joint in self.joints])
            for attribute, values in zip(attributes, UsdSkel.DecomposeTransforms(matrices), strict=True):
                attribute.Set(values, frame)
        UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(["/man/walk"])
        mesh = UsdGeom.Mesh.Define(stage, "/man/body")
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(self.at_rest().astype("f4")))
        mesh.CreateFaceVertexCountsAttr([3] * len(self.triangles))
        mesh.CreateFaceVertexIndicesAttr(self.triangles.ravel().tolist())
        mesh.CreateSubdivisionSchemeAttr("none")
        binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
        binding.CreateSkeletonRel().SetTargets(["/man/rig"])
        binding.CreateJointIndicesPrimvar(False, 4).Set(self.joints_of.ravel().tolist())
        binding.CreateJointWeightsPrimvar(False, 4).Set(self.weights.ravel().tolist())
        binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1))
        stage.GetRootLayer().Save()


def gf(matrix: FloatArray) -> Gf.Matrix4d:
    """A matrix for row vectors, as USD has it."""
    return Gf.Matrix4d(*matrix.T.ravel().tolist())


def skinned(path: Path, frame: float) -> FloatArray:
    """Vertices of the body at a frame, skinned by pxr, m."""
    stage = Usd.Stage.Open(str(path))
    root = UsdSkel.Root(stage.GetPrimAtPath("/man"))
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    body = stage.GetPrimAtPath("/man/body")
    query = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/man/rig")))
    points = Vt.Vec3fArray(UsdGeom.Mesh(body).GetPointsAttr().Get())
    time = Usd.TimeCode(frame)
    if not cache.GetSkinningQuery(body).ComputeSkinnedPoints(
        query.ComputeSkinningTransforms(time), points, time
    ):
        raise RuntimeError(f"pxr does not skin {body.GetPath()}")
    found: FloatArray = np.array(points, float)
    return found
