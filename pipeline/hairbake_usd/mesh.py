"""Triangles from the meshes of a stage, at rest and over time."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel

from .errors import InputError, InputErrors, input_error
from .exchange import Array, Arrays, FloatArray, Header, IntArray
from .rest import RestSpace, character_space
from .stage import (
    all_of,
    apply,
    composition_notes,
    convention,
    find,
    gather,
    open_stage,
    times_without_rest,
    to_world,
    without_instances,
)

STILL = 1e-6
"""Largest displacement of a vertex, relative to the size of the mesh, that counts as none."""

UV, UVS = "uv", ("st", "uv", "UVMap", "map1")
"""Name of the field of texture coordinates, and the primvars that hold them."""


@dataclass(frozen=True)
class Times:
    """`count` time codes from `start`, `step` apart."""

    start: float
    step: float
    count: int

    def codes(self) -> list[float]:
        """The time codes."""
        return [self.start + self.step * i for i in range(self.count)]


@dataclass(frozen=True)
class Selection:
    """What to read of a stage's meshes."""

    prim: str | None
    """Path of the prim at and below which meshes are read; None: the whole stage."""
    time: float | None
    """Time code; None: the rest pose, else the first sample."""
    times: Times | None
    """Time codes at which an animated mesh is read too."""
    carrier: str | None
    """Path of the prim that may carry the mesh rigidly."""
    from_world: FloatArray | None
    """Matrix from the world of the stage at rest to rest space; None: by the character of the meshes."""
    fields: list[str] | None = None
    """Primvars to read, besides texture coordinates and parts; None: no such thing."""


@dataclass(frozen=True)
class Triangles:
    """The faces of a mesh as triangle fans, counter-clockwise from outside."""

    points: FloatArray
    """Vertices in world space, `V × 3`."""
    corners: IntArray
    """Vertices of each triangle, `T × 3`."""
    slots: IntArray
    """The face-vertex of each corner, `T × 3`."""
    faces: IntArray
    """The face of each triangle, `T`."""
    to_world: FloatArray
    """Matrix from the space of the mesh, 4 × 4."""


def read(path: str, selection: Selection) -> tuple[Header, Arrays]:
    """Header and arrays of the selected meshes, merged into one.

    `vertices` and `triangles` are those at rest, in rest space. `moving` holds the vertices in world space at
    each of the selected times, unless the mesh stands still or only moves with the carrier.

    Raises:
        InputErrors: All errors in the meshes.
    """
    stage = open_stage(path)
    header = convention(stage)
    root = find(stage, selection.prim)
    prims = all_of(root, UsdGeom.Mesh, "Mesh")
    notes = composition_notes(stage)
    rests = gather(prims, lambda prim: choose_time(prim, selection.time))
    # The rest pose is read first: baking the skinning overwrites the points.
    parts = gather(list(zip(prims, rests, strict=True)), lambda part: read_triangles(*part, notes))
    firsts = np.cumsum([0] + [len(part.points) for part in parts])[:-1]
    vertices = np.concatenate([part.points for part in parts])
    space, from_world = RestSpace(None), selection.from_world
    if from_world is None:
        space = character_space(prims)
        from_world = space.from_world(None if selection.time is None else Usd.TimeCode(selection.time))
    vertices = apply(from_world, vertices)
    triangles = np.concatenate([part.corners + first for part, first in zip(parts, firsts, strict=True)])
    if not len(triangles):
        raise input_error(
            root.GetPath(),
            "the mesh holds no triangle",
            "faces of three corners or more",
            "name a mesh that has faces",
        )
    arrays: Arrays = {"vertices": ("f64", vertices), "triangles": ("u32", triangles)}
    paint: Header = {"fields": [], "parts": [], "known": []}
    if selection.fields is not None:
        paint = read_paint(list(zip(prims, parts, strict=True)), from_world, selection, arrays)
    if selection.times is not None:
        codes = selection.times.codes()
        moving = read_moving(prims, codes)
        if moving.shape[1] <= triangles.max():
            raise input_error(
                prims[0].GetPath(),
                "has fewer points at some times than at rest",
                "the same points at all times",
                "export the mesh again",
            )
        carrier = find(stage, selection.carrier) if selection.carrier else None
        if deforms(moving, carrier, codes, float(np.ptp(vertices, axis=0).max())):
            arrays["moving"] = ("f64", moving)
    return {**header, **paint, "notes": notes, "space": space.kind}, arrays


def read_paint(
    meshes: list[tuple[Usd.Prim, Triangles]], from_world: FloatArray, selection: Selection, arrays: Arrays
) -> Header:
    """Adds fields and parts of the meshes to `arrays`; the header names them.

    Only fields that all meshes have are read. Vectors are turned to rest space; of colours the red counts.
    """
    time = Usd.TimeCode.Default() if selection.time is None else Usd.TimeCode(selection.time)
    known = [
        {primvar.GetPrimvarName() for primvar in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()}
        for prim, _ in meshes
    ]
    common = set.intersection(*known)
    uvs = next((name for name in UVS if name in common), None)
    names = {name: name for name in selection.fields or () if name in common}
    if uvs is not None:
        names[UV] = uvs
    fields: list[tuple[str, int]] = []
    for field, name in names.items():
        of_mesh = partial(read_field, name=name, time=time, from_world=from_world)
        found = gather(meshes, of_mesh)
        size = min(values.shape[-1] for values in found)
        arrays[f"field:{len(fields)}"] = ("f64", np.concatenate([values[..., :size] for values in found]))
        fields.append((field, size))
    parts: dict[str, list[IntArray]] = {}
    first = 0
    for prim, triangles in meshes:
        everything = np.arange(len(triangles.faces))
        of_prim = {prim.GetName(): everything}
        for subset in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(prim)):
            faces = np.array(subset.GetIndicesAttr().Get(Usd.TimeCode.EarliestTime()) or (), int)
            of_prim[subset.GetPrim().GetName()] = everything[np.isin(triangles.faces, faces)]
        for name, which in of_prim.items():
            parts.setdefault(name, []).append(which + first)
        first += len(everything)
    for k, of_part in enumerate(parts.values()):
        arrays[f"part:{k}"] = ("u32", np.concatenate(of_part))
    return {"fields": fields, "parts": list(parts), "known": sorted(common)}


def read_field(
    mesh: tuple[Usd.Prim, Triangles], name: str, time: Usd.TimeCode, from_world: FloatArray
) -> FloatArray:
    """Values of a primvar at the corners of the triangles, `T × 3 × size`, with a size of 1 to 3.

    Raises:
        InputErrors: Values that are no numbers, or not as many as the mesh needs.
    """
    prim, triangles = mesh
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    path, help = primvar.GetAttr().GetPath(), "paint it again, or name another primvar"
    value: Any = primvar.ComputeFlattened(time)
    if value is None:
        value = primvar.ComputeFlattened(Usd.TimeCode.EarliestTime())
    try:
        values = np.array([value] if np.ndim(value) == 0 else value, float)
    except (TypeError, ValueError):
        message = f"type {primvar.GetTypeName()} holds no numbers"
        raise input_error(path, message, "numbers, vectors or colours", help) from None
    values = values.reshape(len(values), -1)[:, :3]
    of_corner = {
        UsdGeom.Tokens.constant: np.zeros_like(triangles.corners),
        UsdGeom.Tokens.uniform: np.repeat(triangles.faces[:, None], 3, axis=1),
        UsdGeom.Tokens.faceVarying: triangles.slots,
    }.get(primvar.GetInterpolation(), triangles.corners)
    if of_corner.max(initial=-1) >= len(values) or values.shape[1] == 0:
        message = f"has {len(values)} values of interpolation {primvar.GetInterpolation()}"
        raise input_error(path, message, f"at least {of_corner.max() + 1} values", help)
    if primvar.GetTypeName().role == "Color":
        values = values[:, :1]
    elif values.shape[1] == 3:
        values = values @ (from_world @ triangles.to_world)[:3, :3].T
    at_corners: FloatArray = values[of_corner]
    return at_corners


def choose_time(prim: Usd.Prim, time: float | None) -> Usd.TimeCode:
    """The time to read at: `time` if given, else the rest pose, else the first sample."""
    if time is not None:
        return Usd.TimeCode(time)
    points = UsdGeom.Mesh(prim).GetPointsAttr()
    samples = [] if points.Get(Usd.TimeCode.Default()) is not None else points.GetTimeSamples()
    samples = samples or times_without_rest(prim)
    return Usd.TimeCode(samples[0]) if samples else Usd.TimeCode.Default()


def read_points(prim: Usd.Prim, at: Usd.TimeCode) -> FloatArray:
    """Vertices in world space, `V × 3`.

    Raises:
        InputErrors: A vertex is not finite.
    """
    points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(at) or (), float).reshape(-1, 3)
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        key = f"{prim.GetPath()}.points"
        raise input_error(
            key, f"vertex {bad} is not finite at {at}", "finite numbers", "export the mesh again"
        )
    return apply(to_world(prim, at), points)


def read_triangles(prim: Usd.Prim, at: Usd.TimeCode, notes: list[str]) -> Triangles:
    """The triangles of a mesh.

    Raises:
        InputErrors: Faces change over time, or do not match the vertices.
    """
    mesh = UsdGeom.Mesh(prim)
    for attr in (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()):
        if attr.GetNumTimeSamples() > 1:
            raise input_error(
                attr.GetPath(),
                "changes over time",
                "the same faces at all times",
                "export a mesh with constant topology",
            )
    points = read_points(prim, at)
    earliest = Usd.TimeCode.EarliestTime()
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(earliest) or (), int)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(earliest) or (), int)
    check_faces(prim, counts, indices, len(points))
    starts = np.repeat(np.cumsum(counts) - counts, np.maximum(counts - 2, 0))
    step = np.concatenate([np.arange(n - 2) for n in counts]) if len(counts) else np.zeros(0, int)
    slots = np.stack([starts, starts + step + 1, starts + step + 2], axis=1)
    matrix = to_world(prim, at)
    mirrored = np.linalg.det(matrix[:3, :3]) < 0
    if (mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded) != mirrored:
        slots = slots[:, ::-1]
    corners = indices[slots] if len(slots) else np.zeros((0, 3), int)
    faces = np.repeat(np.arange(len(counts)), np.maximum(counts - 2, 0))
    scheme = mesh.GetSubdivisionSchemeAttr()
    if scheme.Get() != UsdGeom.Tokens.none and scheme.HasAuthoredValue():
        notes.append(f"{prim.GetPath()}: a subdivision surface; its control mesh is used")
    return Triangles(points, corners, slots, faces, matrix)


def check_faces(prim: Usd.Prim, counts: Array, indices: Array, vertices: int) -> None:
    """Checks that counts match indices and that every index has a vertex.

    Raises:
        InputErrors: The errors found.
    """
    errors = []
    path, help = prim.GetPath(), "export the mesh again"
    if (counts < 0).any() or counts.sum() != len(indices):
        message = f"the counts sum to {counts.sum()}, for {len(indices)} indices"
        allowed = "counts that sum to the number of indices"
        errors.append(InputError(f"{path}.faceVertexCounts", message, allowed, help))
    if len(indices) and (indices.min() < 0 or indices.max() >= vertices):
        message = f"indices {indices.min()} to {indices.max()}, for {vertices} vertices"
        errors.append(InputError(f"{path}.faceVertexIndices", message, f"0 to {vertices - 1}", help))
    if errors:
        raise InputErrors(*errors)


def read_moving(prims: list[Usd.Prim], codes: list[float]) -> FloatArray:
    """Vertices of all meshes in world space at each time code, `times × V × 3`.

    Skinned meshes are deformed: their points on the stage are overwritten.
    """
    prims = [without_instances(prim) for prim in prims]
    skinned = (prim for prim in prims if UsdSkel.BindingAPI(prim).GetJointIndicesPrimvar().HasValue())
    for root in {UsdSkel.Root.Find(prim) for prim in skinned}:
        if root:
            UsdSkel.BakeSkinning(root, Gf.Interval(codes[0], codes[-1]))
    times = [Usd.TimeCode(code) for code in codes]
    return np.concatenate([np.stack([read_points(prim, time) for time in times]) for prim in prims], axis=1)


def deforms(moving: FloatArray, carrier: Usd.Prim | None, codes: list[float], size: float) -> bool:
    """True if vertices (`times × V × 3`) move relative to the carrier, or to the world without one."""
    local = moving
    if carrier is not None:
        inverses = [np.linalg.inv(to_world(carrier, Usd.TimeCode(code))) for code in codes]
        local = np.stack([apply(inverse, points) for inverse, points in zip(inverses, moving, strict=True)])
    return bool(np.abs(local - local[0]).max() > STILL * size)
