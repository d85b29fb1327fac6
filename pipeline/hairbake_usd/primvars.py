"""Primvars of curves, by their value at each root."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from .curves import CurveType
from .errors import InputError, InputErrors, input_error
from .exchange import Array, FloatArray, IntArray

# Names of primvars, by the conventions of Unreal, Houdini and hairbake's own caches. The first one found is
# read.
IDS = ("groom_id", "id")
GUIDES = ("groom_guide",)
GROUPS = ("groom_group_id", "group_id")
GROUP_NAMES = ("groom_group_name",)
CLUMPS = ("groom_clump_id", "clump_id", "clumpid", "clump")
ROOT_UVS = ("groom_root_uv", "root_uv", "rootuv", "st", "uv")

FACTORS: dict[str, tuple[float, float]] = {
    "length": (0.01, 100),
    "stiffness": (1e-3, 1e3),
    "damping": (0, 1e3),
    "friction": (0, 1e3),
    "drag": (0, 1e3),
    "goal": (0, 1e3),
    "goal_weight": (0, 1),
}
"""Least and greatest value of the factors that curves may have, as `primvars:hairbake:NAME`.

They scale the length of a curve and the properties of its material. Interpolation is constant or uniform;
else the value at the root counts.
"""


@dataclass
class Layout:
    """The type of curves and their control points, which define the number of primvar values."""

    type: CurveType
    counts: IntArray
    """Control points of each curve."""

    def sizes(self, interpolation: str) -> IntArray:
        """Number of values of each curve, for an interpolation other than constant."""
        if interpolation == UsdGeom.Tokens.vertex:
            return self.counts
        if interpolation in (UsdGeom.Tokens.varying, UsdGeom.Tokens.faceVarying):
            sizes = {int(n): self.type.varying(int(n)) for n in np.unique(self.counts)}
            return np.array([sizes[int(n)] for n in self.counts])
        return np.ones(len(self.counts), int)

    def ends(self, path: object, values: Array, interpolation: str) -> tuple[Array, Array]:
        """The values at the root and at the tip of each curve.

        Raises:
            InputErrors: The number of values is wrong; `path` names the attribute.
        """
        if interpolation == UsdGeom.Tokens.constant:
            if len(values) == 1:
                both = np.repeat(values, len(self.counts), axis=0)
                return both, both
            expected = 1
        else:
            sizes = self.sizes(interpolation)
            expected, last = int(sizes.sum()), np.cumsum(sizes) - 1
            if len(values) == expected:
                return values[last - sizes + 1], values[last]
        raise input_error(
            path,
            f"has {len(values)} values",
            f"{expected} values of interpolation {interpolation}",
            "export the attribute again, or remove it",
        )


class Primvars:
    """Primvars of a prim, including inherited ones."""

    def __init__(self, prim: Usd.Prim, layout: Layout, time: Usd.TimeCode, notes: list[str]) -> None:
        """Reads at `time`; primvars that cannot be read are noted in `notes`."""
        self.api, self.layout, self.time, self.notes = UsdGeom.PrimvarsAPI(prim), layout, time, notes
        self.path = prim.GetPath()

    def root(self, names: tuple[str, ...], dtype: type) -> Array | None:
        """Values at the roots of the first primvar found; None for none.

        Raises:
            InputErrors: The number of values is wrong.
        """
        primvar, values = self._find(names)
        if primvar is None or isinstance(values, str):
            return None
        try:
            array: Array = np.array([values] if np.ndim(values) == 0 else values, dtype)
        except (TypeError, ValueError, OverflowError):
            self.notes.append(f"{primvar.GetAttr().GetPath()}: type {primvar.GetTypeName()} is not supported")
            return None
        return self._at_roots(primvar, array)

    def factors(self) -> dict[str, FloatArray]:
        """The factors of the curves, by the names in FACTORS.

        Raises:
            InputErrors: Factors are out of range.
        """
        found: dict[str, FloatArray] = {}
        errors = []
        for name, (least, most) in FACTORS.items():
            values = self.root((f"hairbake:{name}",), float)
            if values is None:
                continue
            values = values.reshape(len(values), -1)[:, 0]
            wrong = np.flatnonzero(~((values >= least) & (values <= most)))
            if len(wrong):
                more = f" ({len(wrong)} curves out of range)" if len(wrong) > 1 else ""
                message = f"{values[wrong[0]]:g} for curve {wrong[0]}{more}"
                key = f"{self.path}.primvars:hairbake:{name}"
                errors.append(InputError(key, message, f"{least:g} to {most:g}", "correct the factor"))
            found[name] = values
        if errors:
            raise InputErrors(*errors)
        return found

    def groups(self) -> tuple[IntArray | None, dict[int, str]]:
        """The group number of each curve, and group names by number.

        Groups that have only names are numbered in alphabetical order.
        """
        group: IntArray | None = self.root(GROUPS, int)
        primvar, values = self._find(GROUP_NAMES)
        if primvar is None:
            return group, {}
        names = np.array([values] if isinstance(values, str) else values, object)
        roots = self._at_roots(primvar, names)
        if group is None:
            group = np.unique(roots.astype(str), return_inverse=True)[1]
        return group, {int(number): str(name) for number, name in zip(group, roots, strict=True)}

    def _find(self, names: tuple[str, ...]) -> tuple[UsdGeom.Primvar | None, Any]:
        """The first primvar with a value, and its flattened value."""
        for name in names:
            primvar = self.api.FindPrimvarWithInheritance(name)
            if primvar and primvar.HasValue():
                return primvar, primvar.ComputeFlattened(self.time)
        return None, None

    def _at_roots(self, primvar: UsdGeom.Primvar, values: Array) -> Array:
        return self.layout.ends(primvar.GetAttr().GetPath(), values, str(primvar.GetInterpolation()))[0]
