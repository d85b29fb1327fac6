"""Which curves of a stage are guides, by their primvar, purpose and name."""

from dataclasses import dataclass

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from .exchange import IntArray

NAMED = 4
"""Largest number of prims that a note lists."""

GUIDE_WORD = "guide"
"""Prims with this in their name hold guides, in any case: `sim_guides`, `hairGuides`."""


@dataclass(frozen=True)
class Role:
    """What the curves of a prim are, unless a primvar tells them apart."""

    guides: bool
    """True for guides, False for strands that are drawn."""
    reason: str
    """Why, for the artist."""


def roles(prims: list[Usd.Prim]) -> list[Role]:
    """The role of each prim: by its purpose, else by its name.

    Curves of purpose proxy stand in for others: they are guides where those others are there.
    """
    purposes = [str(UsdGeom.Imageable(prim).ComputePurpose()) for prim in prims]
    names = distinct_names([prim.GetPath() for prim in prims])
    named = [GUIDE_WORD in name.lower() for name in names]
    drawn = {str(UsdGeom.Tokens.render), str(UsdGeom.Tokens.default_)}
    beside = any(purpose in drawn and not by_name for purpose, by_name in zip(purposes, named, strict=True))
    found = []
    for purpose, by_name in zip(purposes, named, strict=True):
        if purpose == UsdGeom.Tokens.guide:
            found.append(Role(True, "purpose guide"))
        elif purpose == UsdGeom.Tokens.render:
            found.append(Role(False, "purpose render"))
        elif by_name:
            found.append(Role(True, "by name"))
        elif purpose == UsdGeom.Tokens.proxy and beside:
            found.append(Role(True, "purpose proxy, beside curves that are drawn"))
        else:
            found.append(Role(False, f"purpose {purpose}"))
    return found


def distinct_names(paths: list[Sdf.Path]) -> list[str]:
    """The part of each path by which the prims differ, from the name of their common ancestor on."""
    common = paths[0]
    for path in paths:
        common = common.GetCommonPrefix(path)
    parent = common.GetParentPath() if common != Sdf.Path.absoluteRootPath else common
    return [str(path.MakeRelativePath(parent)) for path in paths]


def role_notes(
    prims: list[Usd.Prim], found: list[Role], counts: list[int], flags: list[IntArray | None]
) -> list[str]:
    """What was decided and why, for the artist; `flags` are the primvars that tell guides from strands."""
    notes = []
    together: dict[Role, list[int]] = {}
    for k, (role, flag) in enumerate(zip(found, flags, strict=True)):
        if flag is None:
            together.setdefault(role, []).append(k)
        else:
            marked = int(np.count_nonzero(flag))
            notes.append(f"{prims[k].GetPath()}: {marked} of {counts[k]} curves are guides (primvar)")
    for role, members in together.items():
        paths = ", ".join(str(prims[k].GetPath()) for k in members[:NAMED])
        more = f" and {len(members) - NAMED} more prims" if len(members) > NAMED else ""
        kind = "guides" if role.guides else "strands"
        total = sum(counts[k] for k in members)
        notes.append(f"{kind}: {total} curves of {paths}{more} ({role.reason})")
    return notes
