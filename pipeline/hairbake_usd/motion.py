"""The motion of a joint or of a prim over the time of a stage."""

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from .faults import fail
from .stage import NAMED, all_of, composition_notes, convention, find, moves_only, open_stage, to_world

#: Most samples of a motion: as many as a bake may have frames.
MOST = 1_000_000


def read(path: str, prim_path: str | None, joint: str | None) -> tuple[dict, dict]:
    """Header and arrays of a motion: a matrix to the world for each time code, and one for the rest pose."""
    stage = open_stage(path)
    header, notes = convention(stage), composition_notes(stage)
    if joint is not None:
        prim, pose, rest, samples = _joint(stage, prim_path, joint, notes)
    else:
        prim, pose, rest, samples = _transform(stage, prim_path, notes)
    rate = stage.GetTimeCodesPerSecond()
    codes = _codes(stage, prim, samples, notes)
    matrices = np.stack([pose(Usd.TimeCode(code)) for code in codes])
    arrays = {"matrix": ("f64", matrices), "rest": ("f64", rest)}
    step = codes[1] - codes[0] if len(codes) > 1 else 1.0
    return {
        **header,
        "notes": notes,
        "prim": str(prim.GetPath()),
        "rate": rate,
        "start": codes[0],
        "step": step,
    }, arrays


def _transform(stage: Usd.Stage, prim_path: str | None, notes: list[str]):
    """A prim's own transform; without a path, that of the only prim that moves."""
    if prim_path is None:
        moving = [
            p
            for p in stage.Traverse(Usd.TraverseInstanceProxies())
            if p.IsA(UsdGeom.Xformable) and UsdGeom.Xformable(p).TransformMightBeTimeVarying()
        ]
        if len(moving) != 1:
            named = ", ".join(str(p.GetPath()) for p in moving[:NAMED]) or "none"
            raise fail(
                "",
                f"{len(moving)} prims have a transform that moves",
                "one prim named",
                f"name the prim to follow; those that move: {named}",
            )
        prim = moving[0]
    else:
        prim = find(stage, prim_path)
        if not prim.IsA(UsdGeom.Xformable):
            kind = prim.GetTypeName() or "of no type"
            raise fail(
                prim.GetPath(),
                f"is {kind}, which has no transform",
                "a prim with a transform, or a joint of a skeleton",
                "name another prim",
            )
    samples, above = set(), prim
    while above and not above.IsPseudoRoot():
        for op in UsdGeom.Xformable(above).GetOrderedXformOps() if above.IsA(UsdGeom.Xformable) else ():
            samples.update(op.GetTimeSamples())
        above = above.GetParent()
    # As curves and meshes below it are taken: outside of time, else at the earliest.
    without_rest = moves_only(prim)
    at = Usd.TimeCode(without_rest[0]) if without_rest else Usd.TimeCode.Default()
    notes.append(
        f"{prim.GetPath()}: its rest pose is that "
        + (f"at time code {without_rest[0]:g}" if without_rest else "outside of time")
    )
    return prim, lambda time: to_world(prim, time), to_world(prim, at), sorted(samples)


def _joint(stage: Usd.Stage, prim_path: str | None, joint: str, notes: list[str]):
    """A joint of a skeleton, by its path or by the last name of it."""
    root = find(stage, prim_path)
    skeletons = all_of(root, UsdSkel.Skeleton, "Skeleton")
    cache = UsdSkel.Cache()
    # Skeletons know what animates them from the root that they are bound below.
    for skel_root in {UsdSkel.Root.Find(prim) for prim in skeletons}:
        if skel_root:
            cache.Populate(skel_root, Usd.TraverseInstanceProxies())
    found, all_names = [], []
    for prim in skeletons:
        query = cache.GetSkelQuery(UsdSkel.Skeleton(prim))
        names = [str(name) for name in query.GetJointOrder()] if query else []
        all_names += names
        found += [
            (prim, query, i) for i, name in enumerate(names) if joint in (name, name.rsplit("/", 1)[-1])
        ]
    if len(found) != 1:
        there = ", ".join(name.rsplit("/", 1)[-1] for name in all_names) or "none"
        what = "is no joint" if not found else f"is the name of {len(found)} joints"
        raise fail(
            joint, what, f"one of: {there}", "name a joint, by its whole path where its name is not enough"
        )
    prim, query, index = found[0]
    animation = query.GetAnimQuery()
    if not animation:
        notes.append(
            f"{prim.GetPath()}: no animation is bound to it; its joints stand still in their rest pose"
        )
    samples = list(animation.GetJointTransformTimeSamples()) if animation else []

    def pose(time: Usd.TimeCode) -> np.ndarray:
        joints = query.ComputeJointSkelTransforms(time)
        return to_world(prim, time) @ np.array(joints[index], float).T

    bind = UsdSkel.Skeleton(prim).GetBindTransformsAttr().Get()
    if bind and len(bind) > index:
        # Bind transforms are in the world already.
        rest = np.array(bind[index], float).T
    else:
        notes.append(
            f"{prim.GetPath()}: no bind transforms; the rest pose of the joint is that of its first sample"
        )
        rest = pose(Usd.TimeCode(samples[0]) if samples else Usd.TimeCode.Default())
    return prim, pose, rest, samples


def _codes(stage: Usd.Stage, prim: Usd.Prim, samples: list[float], notes: list[str]) -> list[float]:
    """Time codes evenly apart over the motion: those of the stage, else of the samples; finer than one where the samples are."""
    if stage.HasAuthoredTimeCodeRange():
        start, end = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    elif samples:
        start, end = samples[0], samples[-1]
    else:
        raise fail(
            prim.GetPath(),
            "does not move, and the stage has no range of time codes",
            "samples over time, or startTimeCode and endTimeCode",
            "name a prim that moves",
        )
    if not samples:
        notes.append(f"{prim.GetPath()}: does not move")
    gaps = np.diff(samples)
    finest = float(gaps.min()) if len(gaps) and gaps.min() > 1e-3 else 1.0
    step = finest if finest < 1 else 1.0
    count = np.floor((end - start) / step + 1e-6) + 1
    if not np.isfinite(count) or not 1 <= count <= MOST:
        raise fail(
            "startTimeCode",
            f"time codes {start:g} to {end:g}",
            f"1 to {MOST} samples",
            "correct the range of the stage",
        )
    return [start + step * i for i in range(int(count))]
