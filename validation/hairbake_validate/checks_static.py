"""Checks of what does not move: files, manifest.json, metadata, prims, topology, primvars and clips."""

import hashlib
import math
import re
from collections.abc import Callable, Iterator

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdValidation

from . import tolerances
from .cache import (
    GROOM,
    GUIDES,
    HAIR,
    HEAD,
    MATERIAL,
    RECORD,
    ROOT_LAYER,
    Cache,
    Unreadable,
    read_frame,
)
from .report import Check, Finding, Severity

# Not the work folder of a bake, from which it goes on or tells that it is done.
TEMPORARY = re.compile(r"^\.(?!hairbake$)|\.tmp|\.part$|~$")
FRAME_FILE = re.compile(r"hair\.0*(-?\d+)\.usdc")

# Guides that a strand names, with their weights.
FOLLOWED = 3

# Pixar's validators that are left out: the first two take the template of the clips for the path of a file
# (missing layers are found by the validator of composition, missing frames by ours), the last two look at what
# `metadata` does.
LEFT_OUT = {
    "usdUtilsValidators:UsdzPackageValidator",
    "usdUtilsValidators:MissingReferenceValidator",
    "usdValidation:StageMetadataChecker",
    "usdGeomValidators:StageMetadataChecker",
}

RECORD_CHECK = Check(
    "record", "manifest.json names format, version, inputs, settings, layers and every frame once"
)
CHECKSUMS = Check("checksums", "every file has the sha256 that manifest.json gives")
FIGURES = Check("figures", "manifest.json holds finite figures for every frame")
TEMPORARIES = Check("temporaries", "no temporary files, and no frame files outside the range, are left")
FRAMEWORK = Check("framework", "Pixar's UsdValidation validators find neither errors nor warnings")
METADATA = Check(
    "metadata", "default prim, units, up axis, one frame a time code, and a frame range are authored"
)
SCALE = Check("scale", "widths are those of hair in the stage's unit", severity=Severity.WARNING)
PRIMS = Check(
    "prims",
    "prims have the types, kinds, purposes and curve tokens of a hair cache, and curves stand in world space",
)
MATERIALS = Check("material", f"curves are bound to {MATERIAL}, and it has a surface")
TOPOLOGY = Check("topology", "curve and face counts agree with their points, and every index exists")
PRIMVARS = Check("primvars", "primvars have their type, interpolation and size")
FOLLOWING = Check(
    "following",
    "strands follow guides of the cache, by weights whose sum is 1",
    tolerance=tolerances.WEIGHT_SUM,
)
IDS = Check("ids", "groom_id is unique")
CLIPS = Check("clips", "value clips cover the range and a handle frame at both ends")
RESOLUTION = Check("resolution", "the composed stage resolves moving attributes to the frame files' values")


def record(cache: Cache) -> Iterator[Finding]:
    """manifest.json as `docs/cache.md` has it."""
    shape = {"format": str, "version": int, "hairbake": str, "inputs": list, "layers": list, "frames": list}
    if "settings" not in cache.record:
        yield Finding(RECORD_CHECK, message=f"{RECORD}: settings are missing")
    for key, kind in shape.items():
        if not isinstance(cache.record.get(key), kind):
            yield Finding(RECORD_CHECK, message=f"{RECORD}: {key} is missing or no {kind.__name__}")
    if (cache.record.get("format"), cache.record.get("version")) != ("hairbake-cache", 1):
        yield Finding(RECORD_CHECK, message=f"{RECORD}: not format hairbake-cache, version 1")
    for number, entry in enumerate(recorded(cache, "inputs")):
        if not re.fullmatch("[0-9a-f]{64}", str(entry.get("sha256"))) or not entry.get("file"):
            yield Finding(RECORD_CHECK, message=f"{RECORD}: inputs[{number}] lacks a file or a sha256")
    frames = [entry.get("frame") for entry in recorded(cache, "frames")]
    for frame in sorted(set(cache.frames) - set(frames)):
        yield Finding(RECORD_CHECK, message="no entry in frames", frame=frame)
    for frame in (frame for frame in frames if frame not in cache.frames or frames.count(frame) > 1):
        yield Finding(
            RECORD_CHECK, message=f"{RECORD}: entry for frame {frame} is out of the range or twice there"
        )


def recorded(cache: Cache, key: str) -> list[dict]:
    """The entries of a list in manifest.json, as far as they are objects."""
    entries = cache.record.get(key)
    return [entry for entry in entries if isinstance(entry, dict)] if isinstance(entries, list) else []


def checksums(cache: Cache) -> Iterator[Finding]:
    """Every static layer and every frame against manifest.json."""
    entries = recorded(cache, "layers") + recorded(cache, "frames")
    expected = {str(entry.get("file")): (entry.get("sha256"), entry.get("frame")) for entry in entries}
    for name, (digest, frame) in sorted(expected.items()):
        path = cache.directory / name
        # A missing frame is found by the check of the frames.
        if not path.is_file():
            if frame is None:
                yield Finding(CHECKSUMS, message=f"{name}: no such file")
            continue
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        if found != digest:
            yield Finding(
                CHECKSUMS,
                message=f"{name}: sha256 is {found[:12]}…, recorded {str(digest)[:12]}…",
                frame=frame,
            )
    static = {
        path.name for path in cache.directory.glob("hair*.usd[ac]") if not FRAME_FILE.fullmatch(path.name)
    }
    for name in sorted(static - set(expected)):
        yield Finding(CHECKSUMS, message=f"{name}: no checksum recorded")


def figures(cache: Cache) -> Iterator[Finding]:
    """Every frame's figures: there, and finite."""

    def finite(value) -> bool:
        if isinstance(value, dict | list):
            return all(map(finite, value.values() if isinstance(value, dict) else value))
        return not isinstance(value, float) or math.isfinite(value)

    for entry in recorded(cache, "frames"):
        if not isinstance(entry.get("figures"), dict) or not entry["figures"] or not finite(entry["figures"]):
            yield Finding(FIGURES, message="figures are missing or not finite", frame=entry.get("frame"))


def temporaries(cache: Cache) -> Iterator[Finding]:
    """Files that a bake that was cut short, or an earlier and longer one, leaves behind."""
    for path in sorted(cache.directory.iterdir()):
        frame = FRAME_FILE.fullmatch(path.name)
        if TEMPORARY.search(path.name) or (frame and int(frame[1]) not in cache.frames):
            yield Finding(TEMPORARIES, message=f"{path.name} is left over")


def framework(cache: Cache) -> Iterator[Finding]:
    """The validators that usd-core ships."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    chosen = [validator for validator in validators if validator.GetMetadata().name not in LEFT_OUT]
    for error in UsdValidation.ValidationContext(chosen).Validate(cache.stage):
        if error.GetType() in (
            UsdValidation.ValidationErrorType.Error,
            UsdValidation.ValidationErrorType.Warn,
        ):
            yield Finding(FRAMEWORK, message=f"{error.GetName()}: {error.GetMessage()}")


def metadata(cache: Cache) -> Iterator[Finding]:
    """Stage metadata, authored and not left to fallbacks (which differ between applications)."""
    stage = cache.stage
    if stage.GetDefaultPrim().GetPath() != GROOM:
        yield Finding(METADATA, message=f"defaultPrim is not {GROOM}")
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage) or not cache.metres_per_unit > 0:
        yield Finding(METADATA, message="metersPerUnit is not authored or not above 0")
    if not stage.HasAuthoredMetadata("upAxis") or UsdGeom.GetStageUpAxis(stage) not in ("Y", "Z"):
        yield Finding(METADATA, message="upAxis is not authored as Y or Z")
    if not stage.HasAuthoredMetadata("timeCodesPerSecond") or not stage.GetTimeCodesPerSecond() > 0:
        yield Finding(METADATA, message="timeCodesPerSecond is not authored or not above 0")
    if stage.GetFramesPerSecond() != stage.GetTimeCodesPerSecond():
        yield Finding(METADATA, message="framesPerSecond is not timeCodesPerSecond")
    start, end = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    if not stage.HasAuthoredTimeCodeRange() or not (
        start == round(start) and end == round(end) and start <= end
    ):
        yield Finding(
            METADATA, message=f"startTimeCode {start} and endTimeCode {end} are no range of whole frames"
        )


def scale(cache: Cache) -> Iterator[Finding]:
    """A wrong metersPerUnit is a fault of a factor 10 to 1000; the widths of hair show it."""
    if not UsdGeom.StageHasAuthoredMetersPerUnit(cache.stage):
        return
    low, high = tolerances.WIDTH_M
    for curves in cache.curves:
        width = float(np.median(curves.widths)) * cache.metres_per_unit if len(curves.widths) else low
        if not low <= width <= high:
            yield Finding(
                SCALE,
                message=f"median width is {width:.3g} m, hair has {low:.0e} to {high:.0e} m",
                prim=curves.path,
            )


def prims(cache: Cache) -> Iterator[Finding]:
    """The prims that applications look for, and what they need to draw them."""
    stage = cache.stage
    groom = stage.GetPrimAtPath(GROOM)
    if not groom or not groom.IsA(UsdGeom.Xform) or Usd.ModelAPI(groom).GetKind() != "component":
        yield Finding(PRIMS, message="no Xform of kind component", prim=GROOM)
    head = stage.GetPrimAtPath(HEAD)
    if not head or not head.IsA(UsdGeom.Xform):
        yield Finding(PRIMS, message="no Xform", prim=HEAD)
    for path, purpose in ((HAIR, "default"), (GUIDES, "guide")):
        prim = stage.GetPrimAtPath(path)
        if not prim and (path == HAIR or cache.settings.get("curves") == "strands"):
            continue
        if not prim or not prim.IsA(UsdGeom.BasisCurves):
            yield Finding(PRIMS, message="no BasisCurves", prim=path)
            continue
        curves = UsdGeom.BasisCurves(prim)
        if UsdGeom.Imageable(prim).GetPurposeAttr().Get() != purpose:
            yield Finding(PRIMS, message=f"purpose is not {purpose}", prim=path)
        tokens = (curves.GetTypeAttr().Get(), curves.GetWrapAttr().Get())
        if tokens != ("cubic", "pinned") or curves.GetBasisAttr().Get() not in ("catmullRom", "bspline"):
            yield Finding(
                PRIMS, message=f"type and wrap are {tokens}, basis {curves.GetBasisAttr().Get()}", prim=path
            )
        if UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(cache.first) != Gf.Matrix4d(1):
            yield Finding(PRIMS, message="points are not in world space: the prim has a transform", prim=path)
    for mesh in cache.colliders:
        if UsdGeom.Imageable(stage.GetPrimAtPath(mesh.path)).ComputePurpose() != "guide":
            yield Finding(PRIMS, message="purpose is not guide", prim=mesh.path)


def materials(cache: Cache) -> Iterator[Finding]:
    """What a renderer finds who asks for the material of the curves; composed, so that a target outside of /groom, which is lost
    where that is referenced, is none.
    """
    for curves in cache.curves:
        prim = cache.stage.GetPrimAtPath(curves.path)
        if not prim.HasAPI(UsdShade.MaterialBindingAPI):
            yield Finding(MATERIALS, message="MaterialBindingAPI is not applied", prim=curves.path)
            continue
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        if not material or material.GetPath() != MATERIAL:
            found = material.GetPath() if material else "nothing"
            yield Finding(MATERIALS, message=f"bound to {found}", prim=curves.path)
        elif not material.ComputeSurfaceSource()[0]:
            yield Finding(MATERIALS, message=f"{MATERIAL} has no surface", prim=curves.path)


def topology(cache: Cache) -> Iterator[Finding]:
    """Counts against points, for curves and colliders."""
    for curves in cache.curves:
        if not len(curves.counts) or curves.counts.min() < 2:
            yield Finding(TOPOLOGY, message="no curves, or one of fewer than 2 points", prim=curves.path)
        elif curves.counts.sum() != len(curves.rest):
            yield Finding(
                TOPOLOGY,
                message=f"curveVertexCounts sum to {curves.counts.sum()}, rest holds {len(curves.rest)} points",
                prim=curves.path,
            )
    for mesh in cache.colliders:
        if not mesh.sound:
            yield Finding(
                TOPOLOGY,
                message="no triangles, an index without a point, or points that are not finite",
                prim=mesh.path,
            )


def primvars(cache: Cache) -> Iterator[Finding]:
    """Name, type, interpolation and size of each primvar, and of the widths."""
    types = Sdf.ValueTypeNames
    per_curve = {
        "groom_id": types.IntArray,
        "groom_group_id": types.IntArray,
        "groom_group_name": types.StringArray,
        "groom_guide": types.IntArray,
        "groom_root_uv": types.TexCoord2fArray,
    }
    for curves in cache.curves:
        prim = cache.stage.GetPrimAtPath(curves.path)
        total, each = int(curves.counts.sum()), len(curves.counts)
        api = UsdGeom.PrimvarsAPI(prim)
        wanted = [(name, kind, "uniform", each) for name, kind in per_curve.items()] + [
            ("rest", types.Point3fArray, "vertex", None)
        ]
        if curves.path == HAIR:
            wanted.append(("groom_closest_guides", types.IntArray, "uniform", FOLLOWED * each))
            wanted.append(("groom_guide_weights", types.FloatArray, "uniform", FOLLOWED * each))
        for name, kind, interpolation, size in wanted:
            primvar = api.GetPrimvar(name)
            if not primvar or not primvar.HasValue():
                yield Finding(PRIMVARS, message=f"{name} is missing", prim=curves.path)
                continue
            found = (primvar.GetTypeName(), primvar.GetInterpolation())
            if found != (kind, interpolation):
                yield Finding(
                    PRIMVARS,
                    message=f"{name} is {found[0]}, {found[1]}, not {kind}, {interpolation}",
                    prim=curves.path,
                )
            # The size of the rest points is the topology's own check.
            if size is not None and len(primvar.Get()) != size:
                yield Finding(
                    PRIMVARS,
                    message=f"{name} has {len(primvar.Get())} values for {each} curves, not {size}",
                    prim=curves.path,
                )
        if UsdGeom.BasisCurves(prim).GetWidthsInterpolation() != "vertex":
            yield Finding(
                PRIMVARS,
                message="widths are not vertex (varying with pinned curves misrenders)",
                prim=curves.path,
            )
        if len(curves.widths) != total:
            yield Finding(
                PRIMVARS, message=f"{len(curves.widths)} widths for {total} points", prim=curves.path
            )
        elif not (np.isfinite(curves.widths) & (curves.widths > 0)).all():
            yield Finding(PRIMVARS, message="widths are not all above 0", prim=curves.path)
        if not np.isfinite(curves.rest).all():
            yield Finding(PRIMVARS, message="rest is not finite", prim=curves.path)


def attribute_value(cache: Cache, prim: str, name: str):
    """The value of an attribute, or an empty tuple where there is none."""
    prim = cache.stage.GetPrimAtPath(prim)
    return (prim.GetAttribute(name).Get() if prim and prim.HasAttribute(name) else None) or ()


def following(cache: Cache) -> Iterator[Finding]:
    """What each strand follows: guides that are there, by weights whose sum is 1."""
    names = (f"primvars:groom_{name}" for name in ("closest_guides", "guide_weights"))
    guides, weights = (np.array(attribute_value(cache, HAIR, name)) for name in names)
    if guides.shape != weights.shape or not guides.size or guides.size % FOLLOWED:
        return
    off = np.abs(weights.reshape(-1, FOLLOWED).sum(axis=1) - 1.0)
    if off.max() > tolerances.WEIGHT_SUM or weights.min() < 0.0:
        yield Finding(
            FOLLOWING, value=float(off.max()), message="weights below 0, or whose sum is not 1", prim=HAIR
        )
    there = attribute_value(cache, GUIDES, "primvars:groom_id")
    if there:
        strange = set(guides[weights > 0.0].tolist()) - set(there)
        if strange:
            yield Finding(FOLLOWING, message=f"guide {min(strange)} is not in the cache", prim=HAIR)


def ids(cache: Cache) -> Iterator[Finding]:
    """Two strands of one id cannot be told apart downstream."""
    for curves in cache.curves:
        primvar = UsdGeom.PrimvarsAPI(cache.stage.GetPrimAtPath(curves.path)).GetPrimvar("groom_id")
        values = np.array(primvar.Get() if primvar and primvar.HasValue() else [], int)
        seen, count = np.unique(values, return_counts=True)
        for value in seen[count > 1]:
            at = int(np.flatnonzero(values == value)[1])
            yield Finding(
                IDS,
                message=f"groom_id {value} is there {count[seen == value][0]} times",
                prim=curves.path,
                curve=at,
            )


def clips(cache: Cache) -> Iterator[Finding]:
    """Clip metadata: what it does not cover is held or interpolated in silence."""
    clip = cache.clip
    if clip is None:
        yield Finding(CLIPS, message="no value clips", prim=GROOM)
        return
    if (clip.start, clip.end, clip.stride) != (cache.frames[0], cache.frames[-1], 1):
        yield Finding(
            CLIPS,
            message=f"clips run from {clip.start} to {clip.end} by {clip.stride}, "
            f"the range with its handles from {cache.frames[0]} to {cache.frames[-1]} by 1",
        )
    if (clip.template, clip.prim_path) != ("./hair.####.usdc", GROOM):
        yield Finding(CLIPS, message=f"template {clip.template}, primPath {clip.prim_path}")
    if cache.declared is None:
        yield Finding(CLIPS, message=f"clip manifest {clip.manifest!r} cannot be read")
    # Time samples in the layer that holds the clips beat them.
    root = cache.stage.GetRootLayer()
    for path in cache.animated():
        if root.ListTimeSamplesForPath(path):
            yield Finding(CLIPS, message=f"{ROOT_LAYER} holds time samples of {path}, which hide the clips")


def resolution(cache: Cache) -> Iterator[Finding]:
    """Stage against files at the handles, both ends and the middle, where the files and the manifest allow it."""
    if cache.clip is None or cache.declared is None:
        return
    frames = {cache.frames[0], cache.first, (cache.first + cache.last) // 2, cache.last, cache.frames[-1]}
    for frame in sorted(frame for frame in frames if cache.clip.start <= frame <= cache.clip.end):
        try:
            file = read_frame(cache, frame)
        except Unreadable:
            continue
        for path in sorted(set(file.values) & cache.declared):
            attribute = cache.stage.GetAttributeAtPath(path)
            if not attribute or not np.array_equal(
                np.array(attribute.Get(frame)), file.values[path], equal_nan=True
            ):
                yield Finding(RESOLUTION, message=f"{path} does not resolve to the file's value", frame=frame)


STATIC: dict[Check, Callable[[Cache], Iterator[Finding]]] = {
    RECORD_CHECK: record,
    FIGURES: figures,
    TEMPORARIES: temporaries,
    FRAMEWORK: framework,
    METADATA: metadata,
    SCALE: scale,
    PRIMS: prims,
    MATERIALS: materials,
    TOPOLOGY: topology,
    PRIMVARS: primvars,
    FOLLOWING: following,
    IDS: ids,
    CLIPS: clips,
    RESOLUTION: resolution,
}
"""The static checks and what carries them out, in the order of the report; checksums
stand apart, for they read every byte."""
