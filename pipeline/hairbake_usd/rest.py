"""The rest space of a character: that in which its groom, its head and its skin are given at rest.

Below a SkelRoot it is the space of the skeleton's bind transforms, hence that of the asset: it does not
depend on where a shot places the character. Elsewhere it is the world of the stage in its rest pose.
"""

from collections.abc import Iterable

import numpy as np
from pxr import Sdf, Usd, UsdSkel

from .errors import input_error
from .exchange import FloatArray
from .stage import NAMED, times_without_rest, to_world

BIND, WORLD = "bind", "world"
"""Kinds of rest spaces: that of bind transforms, and the world of the stage at rest."""

SAME = 1e-4
"""Largest difference of matrices, relative to their largest entry, that counts as none."""


class RestSpace:
    """The rest space of a character, or of a stage."""

    def __init__(self, skeleton: Usd.Prim | None) -> None:
        """The space of the skeleton's bind transforms; without a skeleton the world of the stage at rest."""
        self.skeleton = skeleton
        self.kind = WORLD if skeleton is None else BIND

    def from_world(self, at: Usd.TimeCode | None = None) -> FloatArray:
        """Matrix from the world of the stage at a time (default: at rest), for column vectors, 4 × 4.

        It is a translation and a rotation: the unit stays that of the stage.

        Raises:
            InputErrors: The transform of the skeleton is singular.
        """
        if self.skeleton is None:
            return np.eye(4)
        return placement(self.skeleton, rest_time(self.skeleton) if at is None else at)


def rest_time(prim: Usd.Prim) -> Usd.TimeCode:
    """The default time; the first sample of the transforms that have no value there, if there are any."""
    times = times_without_rest(prim)
    return Usd.TimeCode(times[0]) if times else Usd.TimeCode.Default()


def character_space(prims: Iterable[Usd.Prim]) -> RestSpace:
    """The rest space of prims that are read together.

    Raises:
        InputErrors: They belong to several characters.
    """
    skeletons = [skeleton_of(prim) for prim in prims]
    paths = sorted({str(skeleton.GetPath()) for skeleton in skeletons if skeleton is not None})
    if len(paths) > 1 and not all(skeletons):
        return RestSpace(None)
    roots = {str(UsdSkel.Root.Find(skeleton).GetPath()) for skeleton in skeletons if skeleton is not None}
    if len(roots) > 1:
        listed = ", ".join(sorted(roots)[:NAMED])
        raise input_error(
            "",
            f"the prims belong to {len(roots)} characters: {listed}",
            "prims of one character",
            f"name one with --prim, such as {min(roots)}",
        )
    return RestSpace(skeletons[0] if all(skeletons) and len(paths) == 1 else None)


def skeleton_of(prim: Usd.Prim) -> Usd.Prim | None:
    """The skeleton whose bind space a prim is in: that below the prim's SkelRoot.

    None without a SkelRoot, without a bind and a rest pose, and where skeletons have different bind spaces.
    """
    root = UsdSkel.Root.Find(prim)
    if not root:
        return None
    below = Usd.PrimRange(root.GetPrim(), Usd.TraverseInstanceProxies())
    skeletons = [each for each in below if each.IsA(UsdSkel.Skeleton) and to_bind(each) is not None]
    if not skeletons:
        return None
    first = placement(skeletons[0], rest_time(skeletons[0]))
    others = (placement(each, rest_time(each)) for each in skeletons[1:])
    same = all(np.abs(other - first).max() <= SAME * max(1.0, np.abs(first).max()) for other in others)
    return skeletons[0] if same else None


def to_bind(skeleton: Usd.Prim) -> FloatArray | None:
    """Matrix from the space of a skeleton to that of its bind transforms; None if they are not known.

    The root joint is at rest where it was bound.
    """
    schema = UsdSkel.Skeleton(skeleton)
    bind, rest = (attr.Get() for attr in (schema.GetBindTransformsAttr(), schema.GetRestTransformsAttr()))
    if not bind or not rest:
        return None
    # The first joint has no parent: its local transform is that in the space of the skeleton.
    at_rest: FloatArray = np.array(rest[0], float).T
    if abs(np.linalg.det(at_rest[:3, :3])) < 1e-30:
        return None
    matrix: FloatArray = np.array(bind[0], float).T @ np.linalg.inv(at_rest)
    return matrix


def own_bind_space(skeleton: Usd.Prim) -> FloatArray:
    """As `to_bind`; if that is not known, the skeleton was bound in its own space."""
    matrix = to_bind(skeleton)
    return np.eye(4) if matrix is None else matrix


def placement(skeleton: Usd.Prim, at: Usd.TimeCode) -> FloatArray:
    """Matrix from world at a time to the bind space of a skeleton, without its scale."""
    matrix = own_bind_space(skeleton) @ np.linalg.inv(to_world(skeleton, at))
    scale = abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3)
    rigid: FloatArray = np.diag([1 / scale] * 3 + [1.0]) @ matrix
    return rigid


def counterparts(paths: list[str], source: Usd.Stage, near: Usd.Prim) -> list[Usd.Prim] | None:
    """The prims that those of another stage at `paths` are in the stage of `near`; None if one is not there.

    Where the stage has several, as of two characters of one asset, it is that with the longest path in common
    with `near`; None if that is not one prim.
    """
    stage = near.GetStage()
    layers = {layer.identifier for layer in source.GetLayerStack(includeSessionLayers=False)}
    by_spec: dict[Sdf.Path, list[Usd.Prim]] = {}
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        for spec in prim.GetPrimStack():
            if spec.layer.identifier in layers:
                by_spec.setdefault(spec.path, []).append(prim)
    found = []
    for path in map(Sdf.Path, paths):
        # What an asset refers to has no specs of its own in it.
        above = next((each for each in path.GetAncestorsRange() if each in by_spec), None)
        if above is None:
            return None
        prims = (stage.GetPrimAtPath(path.ReplacePrefix(above, prim.GetPath())) for prim in by_spec[above])
        shared = {
            prim: len(prim.GetPath().GetCommonPrefix(near.GetPath()).GetPrefixes()) for prim in prims if prim
        }
        nearest = [prim for prim, length in shared.items() if length == max(shared.values())]
        if len(nearest) != 1:
            return None
        found += nearest
    return found


def counterpart(prim: Usd.Prim, stage: Usd.Stage) -> Usd.Prim | None:
    """The prim of another stage that a prim comes from by reference, else that of the same path."""
    layers = {layer.identifier for layer in stage.GetLayerStack(includeSessionLayers=False)}
    paths = [spec.path for spec in prim.GetPrimStack() if spec.layer.identifier in layers]
    found = (stage.GetPrimAtPath(path) for path in [*paths, prim.GetPath()])
    return next((other for other in found if other and other.IsDefined()), None)
