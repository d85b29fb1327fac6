"""Alembic: a cache for what does not read USD, and curves of other programs as USD to import.

    python -m hairbake.alembic out/cache -o hair.abc
    python -m hairbake.alembic hair.abc -o hair.usda     # then: hairbake import groom hair.usda -o groom.json

Needs `alembic3d` (`pip install "hairbake[alembic]"`); USD files also need `usd-core`.
"""

import argparse
import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import imath
import numpy as np
from alembic3d import Abc, AbcCoreAbstract, AbcGeom

from .cache import Array, Cache, Curves, FloatArray, IntArray
from .program import HairbakeError

UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0}
GROOM_VERSION = (1, 4)
"""Version of the schema of grooms in Alembic (Epic Games, "Using Alembic for grooms in Unreal Engine")."""
BASES = {
    AbcGeom.BasisType.kBsplineBasis: "bspline",
    AbcGeom.BasisType.kCatmullromBasis: "catmullRom",
    AbcGeom.BasisType.kBezierBasis: "bezier",
}
ATTRIBUTES = (
    AbcGeom.IInt32GeomParam,
    AbcGeom.IInt16GeomParam,
    AbcGeom.IFloatGeomParam,
    AbcGeom.IV2fGeomParam,
    AbcGeom.IV3iGeomParam,
    AbcGeom.IV3fGeomParam,
    AbcGeom.IStringGeomParam,
)
"""Kinds of attributes that are read."""
UNIFORM = "uni"
"""Scope of attributes with a value for each curve."""


def write_cache(cache: Cache, file: Path) -> dict[str, int]:
    """Writes a cache as Alembic, Y up, in its unit: objects `hair` and `guides`, as far as it has them.

    Ids, groups, root coordinates and closest guides are the attributes of the schema of grooms; every frame
    has points and velocities.

    Returns:
        Number of curves by object.
    """
    with whole(file) as part:
        # Alembic writes the end of a file when nothing refers to it any more.
        return write_archive(cache, part)


def write_archive(cache: Cache, file: Path) -> dict[str, int]:
    """Writes the archive of [`write_cache`]."""
    archive = Abc.CreateArchiveWithInfo(str(file), "hairbake", str(cache.directory))
    index = archive.addTimeSampling(AbcCoreAbstract.TimeSampling(1 / cache.fps, cache.frames[0] / cache.fps))
    root = AbcGeom.OXform(archive.getTop(), "groom")
    user = root.getSchema().getUserProperties()
    for name, value in zip(("groom_version_major", "groom_version_minor"), GROOM_VERSION, strict=True):
        Abc.OInt16Property(user, name).setValue(value)
    Abc.OStringProperty(user, "groom_tool").setValue("hairbake")
    counts: dict[str, int] = {}
    for curves in (cache.curves(name) for name in ("hair", "guides") if cache.description[name]):
        schema = AbcGeom.OCurves(root, curves.name, index).getSchema()
        write_attributes(schema.getArbGeomParams(), curves)
        for frame in cache.frames:
            write_frame(schema, curves, frame)
        counts[curves.name] = len(curves.counts)
    return counts


@contextmanager
def whole(file: Path) -> Iterator[Path]:
    """A path to write to in place of `file`, which takes its name at the end, or nothing does."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=file.parent, prefix=".") as folder:
        part = Path(folder) / file.name
        yield part
        part.replace(file)


def write_frame(schema: Any, curves: Curves, frame: int) -> None:
    """Writes one frame of curves."""
    # Alembic's samples refer to arrays, which have to live until they are written.
    vectors = [upright(curves.cache, array) for array in (curves.points(frame), curves.velocities(frame))]
    points, velocities = (imath.V3fArrayFromBuffer(np.ascontiguousarray(v, np.float32)) for v in vectors)
    widths = imath.FloatArrayFromBuffer(np.ascontiguousarray(curves.widths, np.float32))
    counts = imath.IntArrayFromBuffer(np.ascontiguousarray(curves.counts, np.int32))
    sample = AbcGeom.OCurvesSchemaSample(
        points,
        counts,
        AbcGeom.CurveType.kCubic,
        AbcGeom.CurvePeriodicity.kNonPeriodic,
        AbcGeom.OFloatGeomParamSample(widths, AbcGeom.GeometryScope.kVertexScope),
        AbcGeom.OV2fGeomParamSample(),
        AbcGeom.ON3fGeomParamSample(),
        next(basis for basis, name in BASES.items() if name == curves.cache.description["basis"]),
    )
    sample.setVelocities(velocities)
    schema.set(sample)


def upright(cache: Cache, vectors: FloatArray) -> FloatArray:
    """Vectors with Y up."""
    return vectors if cache.up_axis == "Y" else vectors[..., [0, 2, 1]] * np.array([1, 1, -1])


def write_attributes(parent: Any, curves: Curves) -> None:
    """Writes the attributes of a groom, one value for each curve."""
    integers, names = imath.IntArrayFromBuffer, imath.StringArray(len(curves.groups))
    for i, group in enumerate(curves.groups.tolist()):
        names[i] = curves.cache.groups[group]
    is_guide = np.full(len(curves.counts), curves.name == "guides", np.int32)
    write_attribute(parent, "groom_guide", "Int32", integers(is_guide))
    write_attribute(parent, "groom_id", "Int32", integers(curves.ids))
    write_attribute(parent, "groom_group_id", "Int32", integers(curves.groups))
    write_attribute(parent, "groom_group_name", "String", names)
    write_attribute(parent, "groom_root_uv", "V2f", imath.V2fArrayFromBuffer(curves.root_uv))
    if curves.name == "hair" and curves.cache.has_guides:
        guides, weights = curves.closest_guides, curves.guide_weights
        write_attribute(parent, "groom_closest_guides", "V3i", imath.V3iArrayFromBuffer(guides))
        write_attribute(parent, "groom_guide_weights", "V3f", imath.V3fArrayFromBuffer(weights))


def write_attribute(parent: Any, name: str, kind: str, values: Any) -> None:
    """Writes an attribute with a value of a kind, such as `V3f`, for each curve."""
    scope = AbcGeom.GeometryScope.kUniformScope
    parameter = getattr(AbcGeom, f"O{kind}GeomParam")(parent, name, False, scope, 1)
    parameter.set(getattr(AbcGeom, f"O{kind}GeomParamSample")(values, scope))


@dataclass(frozen=True)
class AlembicCurves:
    """Curves of an Alembic file at one time, in world space, in the file's unit."""

    path: str
    """Path of the object, such as `/groom/hair`."""
    points: FloatArray
    """`N × 3`"""
    counts: IntArray
    """Number of points of each curve, `n`."""
    kind: Literal["cubic", "linear"]
    basis: str
    periodic: bool
    widths: FloatArray
    """Diameters: none, one, one for each curve, or one for each point."""
    velocities: FloatArray
    """Per second, `N × 3`, or none."""
    attributes: dict[str, Array]
    """Attributes with a value for each curve, by name; numbers, vectors or text."""


def read_curves(file: Path, seconds: float | None = None) -> list[AlembicCurves]:
    """All curves of an Alembic file at a time, s; by default that of their first sample.

    Raises:
        ValueError: the file is not Alembic, or holds no curves.
    """
    try:
        archive = Abc.IArchive(str(file))
    except RuntimeError as error:
        raise ValueError(f"{file} is not an Alembic file: {error}") from error
    found = [curves_at(thing, matrices, seconds) for thing, matrices in walk(archive.getTop(), [])]
    if not found:
        raise ValueError(f"{file} holds no curves")
    return found


def walk(thing: Any, transforms: list[Any]) -> Iterator[tuple[Any, list[Any]]]:
    """The curves below an object, each with the transforms above it."""
    for i in range(thing.getNumChildren()):
        child = thing.getChild(i)
        if AbcGeom.ICurves.matches(child.getMetaData()):
            yield AbcGeom.ICurves(thing, child.getName()), transforms
        is_transform = AbcGeom.IXform.matches(child.getMetaData())
        below = (
            [*transforms, AbcGeom.IXform(thing, child.getName()).getSchema()] if is_transform else transforms
        )
        yield from walk(child, below)


def curves_at(curves: Any, transforms: list[Any], seconds: float | None) -> AlembicCurves:
    """Curves at a time."""
    schema = curves.getSchema()
    start = schema.getTimeSampling().getSampleTime(0) if seconds is None else seconds
    at = Abc.ISampleSelector(start)
    value = schema.getValue(at)
    points = np.array(value.getPositions(), np.float64).reshape(-1, 3)
    velocities = value.getVelocities()
    speeds = np.array(velocities if velocities is not None else [], np.float64).reshape(-1, 3)
    for transform in reversed(transforms):
        matrix = np.array(transform.getValue(at).getMatrix(), np.float64)  # Row vectors.
        points, speeds = points @ matrix[:3, :3] + matrix[3, :3], speeds @ matrix[:3, :3]
    widths = schema.getWidthsParam()
    sample = widths.getExpandedValue(at) if widths.valid() else None
    return AlembicCurves(
        path=curves.getFullName(),
        points=points,
        counts=np.array(value.getCurvesNumVertices(), np.int32),
        kind="linear" if value.getType() == AbcGeom.CurveType.kLinear else "cubic",
        basis=BASES.get(value.getBasis(), "catmullRom"),
        periodic=value.getWrap() == AbcGeom.CurvePeriodicity.kPeriodic,
        widths=np.array(sample.getVals() if sample else [], np.float64),
        velocities=speeds,
        attributes=dict(read_attributes(schema.getArbGeomParams(), at)),
    )


def read_attributes(parent: Any, at: Any) -> Iterator[tuple[str, Array]]:
    """Attributes with a value for each curve."""
    if not parent.valid():
        return
    for i in range(parent.getNumProperties()):
        header = parent.getPropertyHeader(i)
        kind = next((kind for kind in ATTRIBUTES if kind.matches(header)), None)
        if kind is None or header.getMetaData().get("geoScope") != UNIFORM:
            continue
        sample = kind(parent, header.getName()).getExpandedValue(at)
        values = sample.getVals()
        yield header.getName(), np.array(list(values) if kind is AbcGeom.IStringGeomParam else values)


def write_usd(curves: list[AlembicCurves], file: Path, metres_per_unit: float) -> None:
    """Writes curves as USD, Y up; their attributes become primvars."""
    # Only this direction needs USD.
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt  # noqa: PLC0415

    stage = Usd.Stage.CreateNew(str(file))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, metres_per_unit)
    types = {
        (1, "i"): Sdf.ValueTypeNames.IntArray,
        (1, "f"): Sdf.ValueTypeNames.FloatArray,
        (1, "U"): Sdf.ValueTypeNames.StringArray,
        (2, "f"): Sdf.ValueTypeNames.TexCoord2fArray,
    }
    for thing in curves:
        prim = UsdGeom.BasisCurves.Define(stage, thing.path)
        prim.CreateTypeAttr(thing.kind)
        prim.CreateBasisAttr(thing.basis)
        prim.CreateWrapAttr(
            "periodic" if thing.periodic else "pinned" if thing.kind == "cubic" else "nonperiodic"
        )
        prim.CreateCurveVertexCountsAttr(Vt.IntArray.FromNumpy(thing.counts))
        prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(thing.points.astype(np.float32)))
        if len(thing.velocities):
            prim.CreateVelocitiesAttr(Vt.Vec3fArray.FromNumpy(thing.velocities.astype(np.float32)))
        if len(thing.widths):
            prim.CreateWidthsAttr(Vt.FloatArray.FromNumpy(thing.widths.astype(np.float32)))
            scopes = {len(thing.points): "vertex", len(thing.counts): "uniform"}
            prim.SetWidthsInterpolation(scopes.get(len(thing.widths), "constant"))
        for name, values in thing.attributes.items():
            columns, each = values.reshape(len(values), -1).shape[1], values.dtype.kind
            # Three guides for each curve are an array of numbers in USD.
            scalars = columns == 3
            kind = types.get((1 if scalars else columns, each))
            if kind is not None:
                primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
                    name, kind, "uniform", columns if scalars else -1
                )
                primvar.Set(
                    values.ravel().tolist()
                    if scalars or columns == 1
                    else [Gf.Vec2f(*v) for v in values.tolist()]
                )
    stage.SetDefaultPrim(stage.GetPrimAtPath(Sdf.Path(curves[0].path).GetPrefixes()[0]))
    stage.Save()


def main() -> None:
    """Converts a file, and prints the numbers of curves as JSON."""
    parser = argparse.ArgumentParser(
        prog="hairbake.alembic", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", type=Path, help="folder of a cache, or an Alembic file")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help=".abc for a cache; .usda or .usdc for an Alembic file",
    )
    parser.add_argument("--time", type=float, help="time in an Alembic file, s [default: its first sample]")
    parser.add_argument(
        "--units", choices=UNITS, default="m", help="unit of an Alembic file, which has none [default: m]"
    )
    options = parser.parse_args()
    if (options.source.suffix == ".abc") == (options.output.suffix == ".abc"):
        parser.error("one of the two must be Alembic (.abc), the other a cache or USD")
    try:
        if options.output.suffix == ".abc":
            print(json.dumps(write_cache(Cache(options.source), options.output)))
            return
        curves = read_curves(options.source, options.time)
    except (ValueError, HairbakeError) as error:
        parser.error(str(error))
    with whole(options.output) as part:
        write_usd(curves, part, UNITS[options.units])
    print(json.dumps({thing.path: len(thing.counts) for thing in curves}))


if __name__ == "__main__":
    main()
