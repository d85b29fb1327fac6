"""Checks of the composed stage: Pixar's validators, metadata, scale, prims and material."""

from collections.abc import Callable, Iterator

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdShade, UsdValidation

from . import tolerances
from .cache import GROOM, GUIDES, HAIR, HEAD, MATERIAL, Cache
from .report import Check, Finding, Severity

# Pixar's validators that are not run. The first two take the clips' template for the path of a file; missing
# layers are found by the composition validator and missing frames by the check `frames`. The check `metadata`
# covers the last two.
EXCLUDED_VALIDATORS = {
    "usdUtilsValidators:UsdzPackageValidator",
    "usdUtilsValidators:MissingReferenceValidator",
    "usdValidation:StageMetadataChecker",
    "usdGeomValidators:StageMetadataChecker",
}

FRAMEWORK = Check(
    "framework",
    "Pixar's UsdValidation validators report neither errors nor warnings",
    "correct what the named validator of UsdValidation reports",
)
METADATA = Check(
    "metadata",
    "default prim, units, up axis, frame rate and frame range are authored, with one frame a time code",
    "author the metadata in hair.usda",
)
SCALE = Check(
    "scale",
    "widths are those of hair in the unit of the stage",
    "check metersPerUnit and the widths of the groom",
    severity=Severity.WARNING,
)
PRIMS = Check(
    "prims",
    "prims have the types, kinds, purposes and curve tokens of a hair cache, and curves are in world space",
    "correct the prims in hair.topology.usdc; docs/cache.md describes them",
)
MATERIALS = Check(
    "material",
    f"curves are bound to {MATERIAL}, which has a surface",
    f"bind the curves to {MATERIAL} with MaterialBindingAPI, and connect its surface output",
)


def framework(cache: Cache) -> Iterator[Finding]:
    """Runs the validators that usd-core ships."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    chosen = [
        validator for validator in validators if validator.GetMetadata().name not in EXCLUDED_VALIDATORS
    ]
    reported = (UsdValidation.ValidationErrorType.Error, UsdValidation.ValidationErrorType.Warn)
    for error in UsdValidation.ValidationContext(chosen).Validate(cache.stage):
        if error.GetType() in reported:
            yield Finding(FRAMEWORK, message=f"{error.GetName()}: {error.GetMessage()}")


def metadata(cache: Cache) -> Iterator[Finding]:
    """Checks that stage metadata is authored: fallbacks differ between applications."""
    stage = cache.stage
    default = stage.GetDefaultPrim()
    if default.GetPath() != GROOM:
        found = default.GetPath() if default else "missing"
        yield Finding(METADATA, message=f"defaultPrim is {found}, expected {GROOM}")
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage) or not cache.metres_per_unit > 0:
        yield Finding(METADATA, message="metersPerUnit is not authored, or not above 0")
    if not stage.HasAuthoredMetadata("upAxis") or UsdGeom.GetStageUpAxis(stage) not in ("Y", "Z"):
        yield Finding(METADATA, message="upAxis is not authored as Y or Z")
    if not stage.HasAuthoredMetadata("timeCodesPerSecond") or not cache.fps > 0:
        yield Finding(METADATA, message="timeCodesPerSecond is not authored, or not above 0")
    if stage.GetFramesPerSecond() != cache.fps:
        message = (
            f"framesPerSecond is {stage.GetFramesPerSecond()}, timeCodesPerSecond {cache.fps}; expected equal"
        )
        yield Finding(METADATA, message=message)
    start, end = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    whole = start == round(start) and end == round(end) and start <= end
    if not stage.HasAuthoredTimeCodeRange() or not whole:
        message = f"startTimeCode {start} and endTimeCode {end} are not an authored range of whole frames"
        yield Finding(METADATA, message=message)


def scale(cache: Cache) -> Iterator[Finding]:
    """Checks the median width: a wrong metersPerUnit is off by a factor of 10 to 1000."""
    if not UsdGeom.StageHasAuthoredMetersPerUnit(cache.stage):
        return
    low, high = tolerances.WIDTH_M
    for curves in cache.curves:
        width = float(np.median(curves.widths)) * cache.metres_per_unit if len(curves.widths) else low
        if not low <= width <= high:
            message = f"median width is {width:.3g} m, expected {low:.0e} to {high:.0e} m"
            yield Finding(SCALE, message=message, prim=curves.path)


def prims(cache: Cache) -> Iterator[Finding]:
    """Checks the prims that applications look for, and the attributes that they need to draw them."""
    stage = cache.stage
    groom = stage.GetPrimAtPath(GROOM)
    if not groom or not groom.IsA(UsdGeom.Xform) or Usd.ModelAPI(groom).GetKind() != "component":
        yield Finding(PRIMS, message="expected an Xform of kind component", prim=GROOM)
    head = stage.GetPrimAtPath(HEAD)
    if not head or not head.IsA(UsdGeom.Xform):
        yield Finding(PRIMS, message="expected an Xform", prim=HEAD)
    for path, purpose in ((HAIR, "default"), (GUIDES, "guide")):
        prim = stage.GetPrimAtPath(path)
        if not prim and (path == HAIR or cache.settings.get("curves") == "strands"):
            continue
        for message in curve_prim_errors(prim, purpose, cache.first):
            yield Finding(PRIMS, message=message, prim=path)
    for mesh in cache.colliders:
        purpose = UsdGeom.Imageable(stage.GetPrimAtPath(mesh.path)).ComputePurpose()
        if purpose != "guide":
            yield Finding(PRIMS, message=f"purpose is {purpose}, expected guide", prim=mesh.path)


def curve_prim_errors(prim: Usd.Prim, purpose: str, frame: int) -> Iterator[str]:
    """Errors of a prim that must be BasisCurves of this purpose, in world space at `frame`."""
    if not prim or not prim.IsA(UsdGeom.BasisCurves):
        yield "expected BasisCurves"
        return
    curves = UsdGeom.BasisCurves(prim)
    found = UsdGeom.Imageable(prim).GetPurposeAttr().Get()
    if found != purpose:
        yield f"purpose is {found}, expected {purpose}"
    kind, wrap, basis = (a.Get() for a in (curves.GetTypeAttr(), curves.GetWrapAttr(), curves.GetBasisAttr()))
    if (kind, wrap) != ("cubic", "pinned") or basis not in ("catmullRom", "bspline"):
        yield f"type, wrap and basis are {kind}, {wrap}, {basis}; allowed: cubic, pinned, catmullRom/bspline"
    if UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(frame) != Gf.Matrix4d(1):
        yield "the prim has a transform; expected points in world space"


def materials(cache: Cache) -> Iterator[Finding]:
    """Checks the material that a renderer resolves for the curves.

    A target outside /groom, which is lost where /groom is referenced, does not resolve.
    """
    for curves in cache.curves:
        prim = cache.stage.GetPrimAtPath(curves.path)
        if not prim.HasAPI(UsdShade.MaterialBindingAPI):
            yield Finding(MATERIALS, message="MaterialBindingAPI is not applied", prim=curves.path)
            continue
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        if not material or material.GetPath() != MATERIAL:
            found = material.GetPath() if material else "nothing"
            yield Finding(MATERIALS, message=f"bound to {found}, expected {MATERIAL}", prim=curves.path)
        elif not material.ComputeSurfaceSource()[0]:
            yield Finding(MATERIALS, message=f"{MATERIAL} has no surface", prim=curves.path)


STAGE: dict[Check, Callable[[Cache], Iterator[Finding]]] = {
    FRAMEWORK: framework,
    METADATA: metadata,
    SCALE: scale,
    PRIMS: prims,
    MATERIALS: materials,
}
"""The checks of the stage and their functions, in the order of the report."""
