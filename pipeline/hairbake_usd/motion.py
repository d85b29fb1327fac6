"""The motion of a prim or of a joint over the time of a stage."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from .errors import input_error
from .exchange import Arrays, FloatArray, Header
from .stage import (
    NAMED,
    all_of,
    composition_notes,
    convention,
    find,
    open_stage,
    times_without_rest,
    to_world,
    xform_ops,
)

MAX_SAMPLES = 1_000_000
"""Largest number of samples of a motion: as many as a bake may have frames."""


@dataclass(frozen=True)
class Motion:
    """A moving frame of reference."""

    prim: Usd.Prim
    pose: Callable[[Usd.TimeCode], FloatArray]
    """Matrix to world at a time, for column vectors, 4 × 4."""
    rest: FloatArray
    """Matrix to world in the rest pose."""
    samples: list[float]
    """Time codes at which it is sampled, sorted."""


def read(path: str, prim_path: str | None, joint: str | None) -> tuple[Header, Arrays]:
    """Header and arrays of a motion: a matrix to world for each time code, and one for the rest pose.

    Raises:
        InputErrors: There is no such motion.
    """
    stage = open_stage(path)
    header, notes = convention(stage), composition_notes(stage)
    if joint is not None:
        motion = joint_motion(find(stage, prim_path), joint, notes)
    else:
        motion = prim_motion(moving_prim(stage) if prim_path is None else find(stage, prim_path), notes)
    codes = time_codes(stage, motion, notes)
    matrices = np.stack([motion.pose(Usd.TimeCode(code)) for code in codes])
    header |= {
        "notes": notes,
        "prim": str(motion.prim.GetPath()),
        "rate": stage.GetTimeCodesPerSecond(),
        "start": codes[0],
        "step": codes[1] - codes[0] if len(codes) > 1 else 1.0,
    }
    return header, {"matrix": ("f64", matrices), "rest": ("f64", motion.rest)}


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
    samples = {time for op in xform_ops(prim) for time in op.GetTimeSamples()}
    # The same rest pose as that of curves and meshes below it.
    without_rest = times_without_rest(prim)
    at = Usd.TimeCode(without_rest[0]) if without_rest else Usd.TimeCode.Default()
    source = f"time code {without_rest[0]:g}" if without_rest else "the default time"
    notes.append(f"{prim.GetPath()}: the rest pose is that at {source}")
    return Motion(prim, lambda time: to_world(prim, time), to_world(prim, at), sorted(samples))


def joint_motion(root: Usd.Prim, joint: str, notes: list[str]) -> Motion:
    """The motion of a joint, by its path or its name, of a skeleton at or below `root`.

    Raises:
        InputErrors: There is no such joint, or more than one.
    """
    prim, query, index = find_joint(root, joint)
    animation = query.GetAnimQuery()
    if not animation:
        notes.append(f"{prim.GetPath()}: no animation is bound; its joints keep their rest pose")
    samples = list(animation.GetJointTransformTimeSamples()) if animation else []

    def pose(time: Usd.TimeCode) -> FloatArray:
        joints = query.ComputeJointSkelTransforms(time)
        matrix: FloatArray = to_world(prim, time) @ np.array(joints[index], float).T
        return matrix

    bind = UsdSkel.Skeleton(prim).GetBindTransformsAttr().Get()
    if bind and len(bind) > index:
        # Bind transforms are in world space.
        rest: FloatArray = np.array(bind[index], float).T
    else:
        notes.append(f"{prim.GetPath()}: no bind transforms; the rest pose is that of the first sample")
        rest = pose(Usd.TimeCode(samples[0]) if samples else Usd.TimeCode.Default())
    return Motion(prim, pose, rest, samples)


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
    all_names: list[str] = []
    for prim in skeletons:
        query = cache.GetSkelQuery(UsdSkel.Skeleton(prim))
        names = [str(name) for name in query.GetJointOrder()] if query else []
        all_names += names
        found += [
            (prim, query, i) for i, name in enumerate(names) if joint in (name, name.rsplit("/", 1)[-1])
        ]
    if len(found) != 1:
        names = [name.rsplit("/", 1)[-1] for name in all_names]
        message = f"the name of {len(found)} joints" if found else "no such joint"
        allowed = f"one of: {', '.join(names) or 'none'}"
        raise input_error(joint, message, allowed, "name a joint, by its path if its name is not unique")
    return found[0]


def time_codes(stage: Usd.Stage, motion: Motion, notes: list[str]) -> list[float]:
    """Evenly spaced time codes over the range of the stage, or else of the samples.

    The step is 1, or the smallest distance of samples if that is less.

    Raises:
        InputErrors: There is no range of time codes, or it is too long.
    """
    samples, path = motion.samples, motion.prim.GetPath()
    if stage.HasAuthoredTimeCodeRange():
        start, end = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    elif samples:
        start, end = samples[0], samples[-1]
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
    count = np.floor((end - start) / step + 1e-6) + 1
    if not np.isfinite(count) or not 1 <= count <= MAX_SAMPLES:
        raise input_error(
            "startTimeCode",
            f"time codes {start:g} to {end:g}",
            f"1 to {MAX_SAMPLES} samples",
            "correct the range of the stage",
        )
    return [start + step * i for i in range(int(count))]
