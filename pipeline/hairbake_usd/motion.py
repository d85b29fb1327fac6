"""The motion of a prim or of a joint over all samples that a stage has of it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from .errors import InputErrors, input_error
from .exchange import Arrays, FloatArray, Header
from .rest import RestSpace, counterpart, counterparts, own_bind_space, rest_time, skeleton_of
from .stage import (
    NAMED,
    all_of,
    composition_notes,
    convention,
    find,
    open_below_bakes,
    open_stage,
    to_world,
    xform_ops,
)

MAX_SAMPLES = 1_000_000
"""Largest number of samples of a motion: as many as a bake may have frames."""


@dataclass(frozen=True)
class Rest:
    """The space in which the rest pose is given."""

    world: bool = False
    """True for the world of the stage at rest, instead of the rest space of the character."""
    stage: str | None = None
    """Stage in which the head is at rest, if it is another."""


@dataclass(frozen=True)
class GroomCurves:
    """The curves of a groom that the motion carries."""

    stage: str
    """The stage that they were imported from."""
    prims: list[str]
    """Their paths in it."""


@dataclass(frozen=True)
class Motion:
    """A moving frame of reference."""

    prim: Usd.Prim
    pose: Callable[[Usd.TimeCode], FloatArray]
    """Matrix to world at a time, for column vectors, 4 × 4."""
    rest: FloatArray
    """Matrix to the world of the stage in the rest pose."""
    space: RestSpace
    """Rest space of the character."""
    samples: list[float]
    """Time codes at which it is sampled, sorted."""


def read(
    path: str, prim_path: str | None, joint: str | None, rest: Rest, groom: GroomCurves | None = None
) -> tuple[Header, Arrays]:
    """Header and arrays of a motion: a matrix to world for each time code, and one to rest space at rest.

    Raises:
        InputErrors: There is no such motion.
    """
    stage = open_stage(path)
    header, notes = convention(stage), composition_notes(stage)
    motion = find_motion(stage, prim_path, joint, notes)
    space = RestSpace(None) if rest.world else motion.space
    from_world = space.from_world()
    at_rest: FloatArray = from_world @ motion.rest
    if rest.stage is not None:
        at_rest = rest_in(rest.stage, motion, joint, notes, at_rest)
        from_world = at_rest @ np.linalg.inv(motion.rest)
    codes, shot = time_codes(stage, motion, notes)
    matrices = np.stack([motion.pose(Usd.TimeCode(code)) for code in codes])
    header |= {
        "notes": notes,
        "prim": str(motion.prim.GetPath()),
        "rate": stage.GetTimeCodesPerSecond(),
        "start": codes[0],
        "step": codes[1] - codes[0] if len(codes) > 1 else 1.0,
        "shot": shot,
        "space": space.kind,
        "over": [] if groom is None else over_paths(motion.prim, groom, notes),
    }
    arrays: Arrays = {
        "matrix": ("f64", matrices),
        "rest": ("f64", at_rest),
        "from_world": ("f64", from_world),
    }
    return header, arrays


def over_paths(near: Usd.Prim, groom: GroomCurves, notes: list[str]) -> list[str]:
    """Paths of the groom's curves in the stage of the motion; empty, with a note, if none can be changed."""
    try:
        found = counterparts(groom.prims, open_below_bakes(groom.stage), near)
    except InputErrors:
        found = None
    if found is None:
        notes.append(
            f"over mode: the curves of {groom.stage} are not in this stage, or not near {near.GetPath()}"
        )
        return []
    instances = [prim for prim in found if prim.IsInstanceProxy()]
    if instances:
        notes.append(f"over mode: {instances[0].GetPath()} is part of an instance, which no layer can change")
        return []
    paths = [str(prim.GetPath()) for prim in found]
    notes.append(
        f"over mode: a bake puts the motion over {', '.join(paths[:NAMED])} as well; --no-over does not"
    )
    return paths


def find_motion(stage: Usd.Stage, prim_path: str | None, joint: str | None, notes: list[str]) -> Motion:
    """The motion of a joint, or of a prim.

    Raises:
        InputErrors: There is no such motion.
    """
    if joint is not None:
        return joint_motion(find(stage, prim_path), joint, notes)
    return prim_motion(moving_prim(stage) if prim_path is None else find(stage, prim_path), notes)


def rest_in(
    path: str, motion: Motion, joint: str | None, notes: list[str], default: FloatArray
) -> FloatArray:
    """Matrix of the rest pose to the world of another stage, in the unit and axes of the motion's own.

    `default` if the other stage does not have the prim.

    Raises:
        InputErrors: The other stage cannot be read.
    """
    stage = open_stage(path)
    other = counterpart(motion.prim, stage)
    if other is None:
        notes.append(
            f"{motion.prim.GetPath()}: not in {path}; the rest pose is that of the motion's own stage"
        )
        return default
    own = motion.prim.GetStage()
    if joint is not None:
        index = find_joint(motion.prim, joint)[2]
        rest = joint_motion(other, str(UsdSkel.Skeleton(motion.prim).GetJointsAttr().Get()[index]), []).rest
    else:
        rest = prim_motion(other, []).rest
    notes.append(f"the rest pose is that of {other.GetPath()} in {path}")
    matrix: FloatArray = to_metres(own, inverse=True) @ to_metres(stage) @ rest
    return matrix


def to_metres(stage: Usd.Stage, inverse: bool = False) -> FloatArray:
    """Matrix from the unit and axes of a stage to metres, Y up."""
    matrix = np.eye(4)
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
        matrix[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    matrix[:3, :3] *= UsdGeom.GetStageMetersPerUnit(stage)
    return np.linalg.inv(matrix) if inverse else matrix


def moving_prim(stage: Usd.Stage) -> Usd.Prim:
    """The only prim whose transform is animated.

    Raises:
        InputErrors: There is none, or more than one.
    """
    moving = [
        prim
        for prim in stage.Traverse(Usd.TraverseInstanceProxies())
        if prim.IsA(UsdGeom.Xformable) and UsdGeom.Xformable(prim).TransformMightBeTimeVarying()
    ]
    if len(moving) != 1:
        names = ", ".join(str(prim.GetPath()) for prim in moving[:NAMED]) or "none"
        raise input_error(
            "",
            f"{len(moving)} prims have an animated transform",
            "one prim, named with --prim",
            f"name the prim to follow; animated prims: {names}",
        )
    return moving[0]


def prim_motion(prim: Usd.Prim, notes: list[str]) -> Motion:
    """The transform of a prim to world.

    Raises:
        InputErrors: The prim has no transform.
    """
    if not prim.IsA(UsdGeom.Xformable):
        kind = prim.GetTypeName() or "an untyped prim"
        raise input_error(
            prim.GetPath(),
            f"{kind} has no transform",
            "a prim with a transform, or a joint of a skeleton",
            "name another prim",
        )
    # The same rest pose as that of curves and meshes below it.
    at = rest_time(prim)
    source = "the default time" if at.IsDefault() else f"time code {at.GetValue():g}"
    notes.append(f"{prim.GetPath()}: the rest pose is that at {source}")
    space = RestSpace(skeleton_of(prim))
    return Motion(prim, lambda time: to_world(prim, time), to_world(prim, at), space, transform_samples(prim))


def transform_samples(prim: Usd.Prim) -> list[float]:
    """Time samples of the transforms of a prim and its ancestors, sorted."""
    return sorted({time for op in xform_ops(prim) for time in op.GetTimeSamples()})


def joint_motion(root: Usd.Prim, joint: str, notes: list[str]) -> Motion:
    """The motion of a joint, by its path or its name, of a skeleton at or below `root`.

    Raises:
        InputErrors: There is no such joint, or more than one.
    """
    prim, query, index = find_joint(root, joint)
    animation = query.GetAnimQuery()
    if not animation:
        notes.append(f"{prim.GetPath()}: no animation is bound; its joints keep their rest pose")
    samples = set(transform_samples(prim))
    if animation:
        samples.update(animation.GetJointTransformTimeSamples())

    def pose(time: Usd.TimeCode) -> FloatArray:
        joints = query.ComputeJointSkelTransforms(time)
        matrix: FloatArray = to_world(prim, time) @ np.array(joints[index], float).T
        return matrix

    bind = UsdSkel.Skeleton(prim).GetBindTransformsAttr().Get()
    if bind and len(bind) > index:
        # Bind transforms are in their own space, which is that of the asset.
        from_bind = to_world(prim, rest_time(prim)) @ np.linalg.inv(own_bind_space(prim))
        rest: FloatArray = from_bind @ np.array(bind[index], float).T
        return Motion(prim, pose, rest, RestSpace(prim), sorted(samples))
    notes.append(f"{prim.GetPath()}: no bind transforms; the rest pose is that of the first sample")
    first = pose(Usd.TimeCode(min(samples)) if samples else Usd.TimeCode.Default())
    return Motion(prim, pose, first, RestSpace(None), sorted(samples))


def find_joint(root: Usd.Prim, joint: str) -> tuple[Usd.Prim, UsdSkel.SkeletonQuery, int]:
    """Skeleton, its query, and the index of the joint.

    Raises:
        InputErrors: There is no such joint, or more than one.
    """
    skeletons = all_of(root, UsdSkel.Skeleton, "Skeleton")
    cache = UsdSkel.Cache()
    # The animation of a skeleton is bound at or above it, below its SkelRoot.
    for skel_root in {UsdSkel.Root.Find(prim) for prim in skeletons}:
        if skel_root:
            cache.Populate(skel_root, Usd.TraverseInstanceProxies())
    found: list[tuple[Usd.Prim, UsdSkel.SkeletonQuery, int]] = []
    all_paths: list[str] = []
    for prim in skeletons:
        query = cache.GetSkelQuery(UsdSkel.Skeleton(prim))
        paths = [f"{prim.GetPath()}/{name}" for name in query.GetJointOrder()] if query else []
        all_paths += paths
        found += [(prim, query, i) for i, path in enumerate(paths) if is_named(path, joint)]
    if len(found) == 1:
        return found[0]
    paths = [f"{prim.GetPath()}/{query.GetJointOrder()[i]}" for prim, query, i in found]
    names = ", ".join(paths or [path.rsplit("/", 1)[-1] for path in all_paths]) or "none"
    message = f"the name of {len(found)} joints" if found else "no such joint"
    raise input_error(
        joint,
        message,
        f"one of: {names}",
        "give the whole path of the joint, or name the character with --prim" if found else "name a joint",
    )


def is_named(path: str, name: str) -> bool:
    """True if `name` is the path of a joint, skeleton first, or its last components: `head`, `spine/head`."""
    return path == name or (not name.startswith("/") and path.endswith(f"/{name}"))


def time_codes(stage: Usd.Stage, motion: Motion, notes: list[str]) -> tuple[list[float], tuple[float, float]]:
    """Evenly spaced time codes over all samples and over the range of the stage, and that range.

    Shots have samples before their range, where the hair settles. The step is 1, or the smallest distance of
    samples if that is less. Without a range the samples count.

    Raises:
        InputErrors: There are neither samples nor a range, or it is too long.
    """
    samples, path = motion.samples, motion.prim.GetPath()
    if stage.HasAuthoredTimeCodeRange():
        shot = (stage.GetStartTimeCode(), stage.GetEndTimeCode())
    elif samples:
        shot = (samples[0], samples[-1])
    else:
        raise input_error(
            path,
            "is not animated, and the stage has no range of time codes",
            "time samples, or startTimeCode and endTimeCode",
            "name an animated prim",
        )
    if not samples:
        notes.append(f"{path}: is not animated")
    gaps = np.diff(samples)
    finest = float(gaps.min()) if len(gaps) and gaps.min() > 1e-3 else 1.0
    step = finest if finest < 1 else 1.0
    # On the grid of the range, and within the samples outside it.
    before = np.floor(max(0.0, shot[0] - samples[0]) / step + 1e-6) if samples else 0.0
    start, end = shot[0] - step * before, max([shot[1], *samples[-1:]])
    count = np.floor((end - start) / step + 1e-6) + 1
    if not np.isfinite(count) or not 1 <= count <= MAX_SAMPLES:
        raise input_error(
            "startTimeCode",
            f"time codes {start:g} to {end:g}",
            f"1 to {MAX_SAMPLES} samples",
            "correct the range of the stage",
        )
    return [start + step * i for i in range(int(count))], shot
