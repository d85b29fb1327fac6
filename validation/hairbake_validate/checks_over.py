"""Checks of over mode: the stage of the groom with the motion of the cache over it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade

from . import tolerances
from .cache import HEAD, SHOT_LAYER, TRANSFORM, Cache, CacheError, FrameFile, attributes
from .checks_motion import relative_residual, residual_of, simpson_residual
from .geometry import FloatArray, norms, spacing, transformed
from .overs import (
    CLIP_SET,
    MOVING,
    OVER_MANIFEST,
    SKELETON,
    SKELETON_SCHEMA,
    OverPrim,
    Overs,
    Run,
    ShotStage,
    deformed,
    opened,
    overs_of,
    stage_to_metres,
)
from .report import Check, Finding
from .window import Window

TEMPLATE = "./hair.over.####.usdc"
SHUTTER = 0.1
"""Time after a moment at which a transform is taken, for its rate, frames."""
CURVES = 512
"""Largest number of curves of a run whose shape is measured in a frame."""

OVER_STAGE = Check(
    "over_stage",
    "hair.shot.usda opens: hair.over.usda over the stage of the groom, with the metadata of both",
    "restore the stage or its path in hair.shot.usda, or bake again",
)
OVER_UNTOUCHED = Check(
    "over_untouched",
    "the overs change what moves of the groom's curves and nothing else",
    "remove the other opinions from hair.over.usda and hair.shot.usda",
)
OVER_CLIPS = Check(
    "over_clips",
    "the value clips of the overs cover the frame range, and the composed stage draws what they hold",
    "correct the clip metadata in hair.over.usda, or remove stronger opinions from hair.shot.usda",
)
OVER_FRAMES = Check(
    "over_frames",
    "every frame has a readable file of overs with all attributes, of the groom's sizes and finite",
    "bake these frames again, or restore their files",
)
OVER_EXTENT = Check(
    "over_extent",
    "the extent of the overs contains the control points and half the largest width",
    "recompute the extents: renderers cull geometry outside them",
    tolerances.EXTENT_EXCESS_M,
    "m",
)
OVER_ROOTS = Check(
    "over_roots",
    "every root of the groom's curves is on the head or its skin, wherever the stage places it",
    "bake again over this stage: it may have been placed or animated anew",
    tolerances.OVER_ROOT_M,
    "m",
)
OVER_SHAPE = Check(
    "over_shape",
    "the groom's curves are drawn where the strands were baked, in 95 % of them",
    "import the groom with more points, or draw it with more control points: tight bends need them",
    tolerances.OVER_SHAPE,
    "of the length",
)
OVER_REST = Check(
    "over_rest",
    "control points are off the groom's own, carried with the root, by no more than the strand is",
    "bake again over this stage: its curves may have been edited",
    tolerances.OVER_REST_M,
    "m",
)
OVER_VELOCITIES = Check(
    "over_velocities",
    "velocities of control points integrate to their displacement as those of the strands do",
    "check that velocities are per second, and in the space of the prim as it moves after the frame",
    tolerances.VELOCITY_RESIDUAL,
    "of RMS speed",
)


def not_applicable(cache: Cache) -> set[Check]:
    """The checks of over mode that have nothing to look at in a cache.

    By how much curves were lengthened is not in the cache, so that the rest of such curves is not compared.
    """
    overs = opened(cache, Overs)
    if overs is None:
        return {*OVER, *OVER_FRAME}
    lengthened = isinstance(overs, Overs) and all(over.lengthened for over in overs.prims)
    return {OVER_REST} if lengthened else set()


def over_stage(cache: Cache) -> Iterator[Finding]:
    """Checks that the stage composes. A sublayer of another unit or rate would be scaled, or not."""
    yield from composed(OVER_STAGE, opened(cache, Overs))


def composed(check: Check, stages: ShotStage | CacheError | None) -> Iterator[Finding]:
    """Faults of the layer of a bake over a stage, and of the stage with it."""
    if isinstance(stages, CacheError):
        yield Finding(check, message=str(stages))
    if not isinstance(stages, ShotStage):
        return
    layers = stages.shot.GetRootLayer().subLayerPaths
    if list(layers)[:1] != [f"./{stages.name}"]:
        message = f"{SHOT_LAYER} has the sublayers {list(layers)}, expected {stages.name} first"
        yield Finding(check, message=message)
    for name in (
        "metersPerUnit",
        "upAxis",
        "timeCodesPerSecond",
        "framesPerSecond",
        "startTimeCode",
        "endTimeCode",
    ):
        values = {str(stage.GetMetadata(name)) for stage in (stages.shot, stages.original)}
        values.add(str(Usd.Stage.Open(stages.layer).GetMetadata(name)))
        if len(values) > 1:
            yield Finding(check, message=f"{name} of the layers differs: {', '.join(sorted(values))}")
    for other in stages.others:
        yield Finding(check, message=f"{other} moves the same curves once more: take it out of the stage")
    for error in stages.shot.GetCompositionErrors():
        yield Finding(check, message=" ".join(str(error).split()))


def over_untouched(cache: Cache) -> Iterator[Finding]:
    """Compares the stage with and without the overs, and looks for other opinions in them."""
    overs = overs_of(cache)
    if overs is None:
        return
    curves = {over.path for over in overs.prims}
    allowed = Changes(names={*MOVING, SKELETON}, schemas={SKELETON_SCHEMA})
    yield from untouched(OVER_UNTOUCHED, overs, curves, allowed)


@dataclass(frozen=True)
class Changes:
    """What a layer may change of the curves of a stage."""

    names: set[str]
    """Attributes and relationships."""
    schemas: set[str]
    """Schemas that it may apply."""


def untouched(
    check: Check, stages: ShotStage, curves: set[str], allowed: Changes, added: str = ""
) -> Iterator[Finding]:
    """What a layer changes beyond what it may of some curves; all at and below `added` is its own."""
    own = Sdf.Path(added) if added else Sdf.Path.emptyPath
    for path in sorted(attributes(stages.layer)):
        if Sdf.Path(path).name not in allowed.names and not (added and Sdf.Path(path).HasPrefix(own)):
            yield Finding(check, message=f"{stages.name} has an opinion on {path}")
    pair = [prim_types(stage) for stage in (stages.original, stages.shot)]
    pair[1] = {path: name for path, name in pair[1].items() if not (added and Sdf.Path(path).HasPrefix(own))}
    for path in sorted(path for path in {**pair[0], **pair[1]} if pair[0].get(path) != pair[1].get(path)):
        message = (
            f"{path} is {pair[1].get(path, 'missing')}, in the stage below {pair[0].get(path, 'missing')}"
        )
        yield Finding(check, message=message)
    for top in sorted(curves):
        for prim in Usd.PrimRange(stages.original.GetPrimAtPath(top)):
            path = str(prim.GetPath())
            other = stages.shot.GetPrimAtPath(path)
            may = allowed if path == top else Changes(set(), set())
            for message in differences(prim, other, may, stages.cache.first):
                yield Finding(check, message=message, prim=path)


def prim_types(stage: Usd.Stage) -> dict[str, str]:
    """Type of every prim by its path."""
    return {str(prim.GetPath()): str(prim.GetTypeName()) for prim in stage.Traverse()}


def differences(prim: Usd.Prim, other: Usd.Prim, allowed: Changes, frame: int) -> Iterator[str]:
    """What another prim has otherwise, but for what may change."""
    if not other:
        return
    names = [
        {prop.GetName() for prop in each.GetProperties() if prop.IsAuthored()} - allowed.names
        for each in (prim, other)
    ]
    for name in sorted(names[0] ^ names[1]):
        yield f"{name} is {'added' if name in names[1] else 'lost'}"
    for name in sorted(names[0] & names[1]):
        values = [property_values(each, name, frame) for each in (prim, other)]
        if values[0] != values[1]:
            yield f"{name} differs"
    schemas = [
        [name for name in each.GetAppliedSchemas() if name not in allowed.schemas] for each in (prim, other)
    ]
    if schemas[0] != schemas[1]:
        yield f"its schemas are {schemas[1]}, in the stage below {schemas[0]}"
    composed = ("clips", "clipSets", "apiSchemas")
    metadata = [
        {key: str(value) for key, value in each.GetAllMetadata().items() if key not in composed}
        for each in (prim, other)
    ]
    for key in sorted(
        key for key in {**metadata[0], **metadata[1]} if metadata[0].get(key) != metadata[1].get(key)
    ):
        yield f"metadata {key} differs"
    for what, value in (("material", bound_material), ("purpose", purpose)):
        if value(prim) != value(other):
            yield f"its {what} is {value(other)}, in the stage below {value(prim)}"


def property_values(prim: Usd.Prim, name: str, frame: int) -> list[Any]:
    """Type and values of an attribute or the targets of a relationship, to compare."""
    attribute = prim.GetAttribute(name)
    if not attribute:
        return [list(map(str, prim.GetRelationship(name).GetTargets()))]
    values = [attribute.Get(), attribute.Get(frame), UsdGeom.Primvar(attribute).GetInterpolation()]
    return [str(attribute.GetTypeName()), *values]


def bound_material(prim: Usd.Prim) -> str:
    """Path of the material that a renderer resolves; empty for none."""
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    return str(material.GetPath()) if material else ""


def purpose(prim: Usd.Prim) -> str:
    """The purpose that a renderer resolves."""
    return str(UsdGeom.Imageable(prim).ComputePurpose()) if prim.IsA(UsdGeom.Imageable) else ""


def over_clips(cache: Cache) -> Iterator[Finding]:
    """Checks clip metadata, and the values that the composed stage resolves to."""
    overs = overs_of(cache)
    if overs is None:
        return
    frames = sorted(
        {cache.frames[0], cache.first, (cache.first + cache.last) // 2, cache.last, cache.frames[-1]}
    )
    for path in sorted(deformed(overs.shot, [over.path for over in overs.prims])):
        message = "a skeleton or blend shapes move its points once more"
        yield Finding(OVER_CLIPS, message=message, prim=path)
    for over in overs.prims:
        prim = overs.shot.GetPrimAtPath(over.path)
        values = (Usd.ClipsAPI(prim).GetClips() or {}).get(CLIP_SET, {}) if prim else {}
        manifest = values.get("manifestAssetPath", Sdf.AssetPath()).path
        found = (
            values.get("templateAssetPath"),
            values.get("templateStartTime"),
            values.get("templateEndTime"),
            values.get("templateStride"),
            values.get("primPath"),
            manifest,
        )
        expected = (TEMPLATE, cache.frames[0], cache.frames[-1], 1, over.clip_path, f"./{OVER_MANIFEST}")
        if found != expected:
            yield Finding(OVER_CLIPS, message=f"clips are {found}, expected {expected}", prim=over.path)
            continue
        for frame in frames:
            for name, value in frame_values(overs, over, frame).items():
                resolved = np.array(prim.GetAttribute(name).Get(frame))
                if not np.array_equal(resolved, value, equal_nan=True):
                    message = f"{name} does not resolve to the value in the frame's file"
                    yield Finding(OVER_CLIPS, message=message, frame=frame, prim=over.path)


def frame_values(overs: Overs, over: OverPrim, frame: int) -> dict[str, Any]:
    """Values of a prim at a frame, from its file; empty if it cannot be read."""
    try:
        file = overs.read(frame)
    except CacheError:
        return {}
    start = f"{over.clip_path}."
    return {path.removeprefix(start): value for path, value in file.values.items() if path.startswith(start)}


def over_file(window: Window, offset: int = 0) -> FrameFile | str:
    """The file of overs of a frame, or why it cannot be read; kept while the window is near."""
    return window.keep("over file", offset, lambda frame: read_over(window.cache, frame))


def read_over(cache: Cache, frame: int) -> FrameFile | str:
    """The file of overs of a frame, or why it cannot be read."""
    overs = overs_of(cache)
    try:
        return overs.read(frame) if overs and frame in cache.frames else "no such frame"
    except CacheError as error:
        return str(error)


def shapes(overs: Overs) -> dict[str, tuple[int, ...]]:
    """Shape of each value that every file of overs must have."""
    found: dict[str, tuple[int, ...]] = {}
    accelerations = bool(overs.cache.settings.get("accelerations"))
    for over in overs.prims:
        names = ["points", "velocities", *(["accelerations"] if accelerations else [])]
        found |= {f"{over.clip_path}.{name}": (len(over.rest), 3) for name in names}
        found[f"{over.clip_path}.extent"] = (2, 3)
        if over.normals:
            found[f"{over.clip_path}.{over.normals}"] = (over.values, 3)
    return found


def over_frames(window: Window) -> Iterator[Finding]:
    """Checks the file, its attributes and moments, sizes and values."""
    overs, frame = overs_of(window.cache), window.frame
    if overs is None:
        return
    file = over_file(window)
    if isinstance(file, str):
        yield Finding(OVER_FRAMES, message=f"{overs.frame_paths[frame].name}: {file}", frame=frame)
        return
    expected, times = shapes(overs), window.cache.sample_times(frame)
    for path in sorted(set(file.times) | set(expected)):
        if path not in file.times or path not in expected:
            message = f"{path} is {'missing' if path in expected else 'not part of over mode'}"
        elif len(file.times[path]) != len(times) or not np.allclose(
            file.times[path], times, rtol=0, atol=1e-9
        ):
            message = f"{path} has samples at {file.times[path][:5]}, expected {times[:5]}"
        else:
            values = [each[path] for each in (file.values, *file.later.values())]
            if all(value.shape == expected[path] and np.isfinite(value).all() for value in values):
                continue
            message = f"{path} has another size than {expected[path]}, or values that are not finite"
        yield Finding(OVER_FRAMES, message=message, frame=frame)


def valid(window: Window, over: OverPrim, name: str, offset: int = 0) -> FloatArray | None:
    """A value of a prim at a frame; None if it is missing or not valid."""
    file = over_file(window, offset)
    value = file.values.get(f"{over.clip_path}.{name}") if isinstance(file, FrameFile) else None
    shape = (2, 3) if name == "extent" else (len(over.rest), 3)
    right = value is not None and value.shape == shape and np.isfinite(value).all()
    return value.astype(float) if right and value is not None else None


def prims(window: Window) -> list[OverPrim]:
    """The prims of over mode."""
    overs = overs_of(window.cache)
    return overs.prims if overs else []


def over_extent(window: Window) -> Iterator[Finding]:
    """Measures by how much control points and widths exceed the extent, beyond rounding."""
    overs = overs_of(window.cache)
    for over in prims(window):
        points, box = valid(window, over, "points"), valid(window, over, "extent")
        if overs is None or points is None or box is None:
            continue
        half = over.width / 2
        excess = max((box[0] - (points.min(0) - half)).max(), (points.max(0) + half - box[1]).max())
        excess = max(0.0, float(excess) - spacing(box)) * overs.record["metres_per_unit"]
        yield Finding(OVER_EXTENT, excess, frame=window.frame, prim=over.path)


def in_world(window: Window, over: OverPrim, offset: int = 0) -> FloatArray | None:
    """Control points of a prim in the world, m, Y up; None if they are not valid."""
    overs, points = overs_of(window.cache), valid(window, over, "points", offset)
    if overs is None or points is None:
        return None
    return transformed(points, overs.to_world(over, window.frame + offset))


def head_in_world(window: Window) -> FloatArray | None:
    """Matrix from rest space to world in metres, Y up, for row vectors."""
    head = window.get(HEAD, TRANSFORM)
    if head is None:
        return None
    to_world = stage_to_metres(window.cache.stage)
    matrix: FloatArray = np.linalg.inv(to_world) @ head @ to_world
    return matrix


def carried_rest(window: Window, over: OverPrim) -> tuple[FloatArray, Any] | None:
    """The groom's control points as their roots carry them, m, Y up, and the curves of which that is known.

    On skins these are the curves that were baked.
    """
    every, skins = np.arange(len(over.counts)), window.reference.skins
    if not skins:
        head = head_in_world(window)
        return None if head is None else (transformed(over.rest, head), every)
    to_world, known = stage_to_metres(window.cache.stage), np.zeros(len(over.counts), bool)
    rest = transformed(over.rest, np.linalg.inv(to_world))
    turns, moves = np.zeros((len(over.counts), 3, 3)), np.zeros((len(over.counts), 3))
    for run in over.runs:
        curves = next((each for each in window.cache.curves if each.path == run.prim), None)
        motion = None if curves is None else skins.carry(curves, window.get)
        if motion is not None:
            to, of = slice(run.first, run.first + run.count), slice(run.baked, run.baked + run.count)
            turns[to], moves[to], known[to] = motion[0][of], motion[1][of], True
    curve = np.repeat(every, over.counts)
    carried = (rest[:, None] @ turns[curve])[:, 0] + moves[curve]
    return transformed(carried, to_world), every[known]


def sampled(
    over: OverPrim, points: FloatArray, curves: Any, per_segment: int
) -> Iterator[tuple[Any, FloatArray]]:
    """Points of some curves, root first: indices of curves with as many control points, and `n × m × 3`."""
    chosen = np.asarray(curves)
    for count in np.unique(over.counts[chosen]):
        which = chosen[over.counts[chosen] == count]
        controls = points[over.starts[which, None] + np.arange(count)]
        yield which, np.einsum("mc,ncx->nmx", over.weights(int(count), per_segment), controls)


def over_roots(window: Window) -> Iterator[Finding]:
    """Measures the distance of each root from its place on the head, or on a skin."""
    for over in prims(window):
        points, motion = in_world(window, over), carried_rest(window, over)
        if points is None or motion is None:
            continue
        carried, every = motion
        pairs = zip(sampled(over, points, every, 1), sampled(over, carried, every, 1), strict=True)
        worst = (0.0, 0)
        for (which, found), (_, expected) in pairs:
            off = norms(found[:, 0] - expected[:, 0])
            worst = max(worst, (float(off.max()), int(which[off.argmax()])))
        rounding = 2 * spacing(points)
        yield Finding(
            OVER_ROOTS, max(0.0, worst[0] - rounding), frame=window.frame, prim=over.path, curve=worst[1]
        )


def chosen_curves(run: Run) -> Any:
    """Some of the curves of a run, evenly."""
    return np.unique(np.linspace(0, run.count - 1, min(run.count, CURVES)).astype(int))


def over_shape(window: Window) -> Iterator[Finding]:
    """Measures the distance of the baked points from the drawn curves."""
    for over in prims(window):
        points = in_world(window, over)
        if points is None:
            continue
        shares = [share for run in over.runs for share in run_shares(window, over, run, points)]
        if shares:
            value = float(np.percentile(np.concatenate(shares), 95))
            yield Finding(OVER_SHAPE, value, frame=window.frame, prim=over.path)


def run_shares(window: Window, over: OverPrim, run: Run, points: FloatArray) -> Iterator[FloatArray]:
    """Mean distance of baked curves from the curves of the groom, as shares of their lengths."""
    curves = next((each for each in window.cache.curves if each.path == run.prim), None)
    world = None if curves is None else window.get(run.prim, "points")
    if curves is None or world is None:
        return
    baked = transformed(world, stage_to_metres(window.cache.stage))
    for which, drawn in sampled(over, points, run.first + chosen_curves(run), 8):
        index = which - run.first + run.baked
        for count in np.unique(curves.counts[index]):
            same = curves.counts[index] == count
            strands = baked[curves.starts[index[same], None] + np.arange(count)]
            lengths = np.linalg.norm(np.diff(strands, axis=1), axis=2).sum(1)
            means = [distances(*pair).mean() for pair in zip(strands, drawn[same], strict=True)]
            yield np.array(means) / np.maximum(lengths, 1e-9)


def distances(points: FloatArray, line: FloatArray) -> FloatArray:
    """Distance of each point from a polyline."""
    start, along = line[:-1], np.diff(line, axis=0)
    squared = np.maximum((along**2).sum(1), 1e-30)
    at = np.clip(((points[:, None] - start) * along).sum(2) / squared, 0, 1)
    nearest = start + at[..., None] * along
    found: FloatArray = np.sqrt(((points[:, None] - nearest) ** 2).sum(2).min(1))
    return found


def over_rest(window: Window) -> Iterator[Finding]:
    """Measures how much farther control points are from the groom's own, carried by the root, than strands.

    What does not move relative to the head comes back to rounding, and so does what was not baked.
    """
    head = head_in_world(window)
    for over in prims(window):
        points, motion = in_world(window, over), carried_rest(window, over)
        if points is None or motion is None or head is None or over.lengthened:
            continue
        off = norms(points - motion[0])
        moved = np.maximum.reduceat(off, over.starts)
        allowed = np.full(len(over.counts), np.inf)
        allowed[motion[1]] = 0
        for run in over.runs:
            curves = next((each for each in window.cache.curves if each.path == run.prim), None)
            world = None if curves is None else window.get(run.prim, "points")
            if curves is None or world is None:
                allowed[run.first : run.first + run.count] = np.inf
                continue
            to_world = stage_to_metres(window.cache.stage)
            at_root = transformed(transformed(curves.rest, to_world), head)
            if window.reference.skins:
                own = window.reference.skins.carried(curves, window.get)
                at_root = at_root if own is None else transformed(own, to_world)
            strayed = norms(transformed(world, to_world) - at_root)
            of_curve = np.maximum.reduceat(strayed, curves.starts)
            allowed[run.first : run.first + run.count] = of_curve[run.baked : run.baked + run.count]
        open_ended = over.type[1:] == ("bspline", "nonperiodic")
        gain = tolerances.OVER_END_GAIN if open_ended else tolerances.OVER_GAIN
        excess = moved - gain * allowed - 2 * spacing(points)
        curve = int(excess.argmax())
        yield Finding(
            OVER_REST, max(0.0, float(excess[curve])), frame=window.frame, prim=over.path, curve=curve
        )


def over_velocities(window: Window) -> Iterator[Finding]:
    """Compares velocities with displacements as the check `velocities` does, beyond what the strands are off.

    These are the strands that the prim draws: of several prims one may move otherwise than the others. All is
    in the world: the space of the prim may move with the head, and hair in it hardly.
    """
    floor = tolerances.VELOCITY_FLOOR_M_S
    for over in prims(window):
        found = simpson_residual(
            [in_world(window, over, offset) for offset in (-1, 1)],
            [world_rates(window, over, offset) for offset in (-1, 0, 1)],
            window.cache.fps,
        )
        if found is None:
            continue
        (speed, excess), drawn = found, drawn_residual(window, over)
        speeds = [] if drawn is None else drawn[1]
        value = relative_residual(excess, [speed, *speeds[1:]], floor)
        own = 0.0 if drawn is None else relative_residual(drawn[0], speeds, floor)
        yield Finding(OVER_VELOCITIES, max(0.0, value - own), frame=window.frame, prim=over.path)


def drawn_residual(window: Window, over: OverPrim) -> tuple[FloatArray, list[FloatArray]] | None:
    """Excess and speeds of `Residual` of the strands that a prim draws, m/s; None if they are not valid."""
    parts = []
    for run in over.runs:
        curves = next((each for each in window.cache.curves if each.path == run.prim), None)
        residual = None if curves is None else window.once(residual_of, curves)
        if curves is None or residual is None:
            return None
        parts.append([each[run.points(curves)] for each in (residual.excess, *residual.speeds)])
    if not parts:
        return None
    # Of curves that lack points at the frame the speeds of the head are not known.
    joined: list[FloatArray] = [
        np.concatenate(each) * window.cache.metres_per_unit for each in zip(*parts, strict=False)
    ]
    return joined[0], joined[1:]


def world_rates(window: Window, over: OverPrim, offset: int) -> FloatArray | None:
    """Velocities of control points in the world, m/s, as a renderer sees them that moves points and prim."""
    overs, frame = overs_of(window.cache), window.frame + offset
    points, rates = (valid(window, over, name, offset) for name in ("points", "velocities"))
    if overs is None or points is None or rates is None:
        return None
    step = SHUTTER / window.cache.fps
    after = transformed(points + rates * step, overs.to_world(over, frame + SHUTTER))
    moved: FloatArray = (after - transformed(points, overs.to_world(over, frame))) / step
    return moved


OVER: dict[Check, Callable[[Cache], Iterator[Finding]]] = {
    OVER_STAGE: over_stage,
    OVER_UNTOUCHED: over_untouched,
    OVER_CLIPS: over_clips,
}
"""The checks of static layers of over mode and their functions, in the order of the report."""

OVER_FRAME: dict[Check, Callable[[Window], Iterator[Finding]]] = {
    OVER_FRAMES: over_frames,
    OVER_EXTENT: over_extent,
    OVER_ROOTS: over_roots,
    OVER_SHAPE: over_shape,
    OVER_REST: over_rest,
    OVER_VELOCITIES: over_velocities,
}
"""The checks of the frames of over mode and their functions, in the order of the report."""
