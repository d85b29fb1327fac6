"""Check of animated goals: guides are where the curves of the animation lead them.

The cache does not hold the curves. They are read from the animation that it was baked from, and its files.
"""

import hashlib
import json
import re
from collections.abc import Container, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import UsdGeom

from . import tolerances
from .cache import GUIDES, HEAD, TRANSFORM, Cache, CacheError, Curves, attribute_value, read_frame
from .geometry import Array, FloatArray, IntArray, norms
from .report import Check, Finding
from .skins import Skins

GOAL = Check(
    "goal",
    "guides whose weight has been 1 for a while are where animated curves lead them, in 95 % of them",
    "give guides more nodes, or keep the curves out of bodies: contact is stronger than a goal",
    tolerances.GOAL,
    "of the length",
)
SETTLED = 2.0
"""Time after which a guide whose weight is 1 has reached its goal, over the period of the goal.

A deviation dies away as (1 + ω t) exp(−ω t): two periods leave 5e-5 of it.
"""
NEAR = 0.8
"""Share of the part of weight 1 that is measured, unless it is all: strains are linear between nodes."""
FINE = 12
"""Points to which a segment of a curve is refined."""


@dataclass(frozen=True)
class Goal:
    """A goal of an animation, with the guides of a cache."""

    file: dict[str, Any]
    """Its entry in the animation."""
    folder: Path
    """The folder of the animation."""
    unit: float
    """Metres per unit of the curves."""
    up: str
    """The axis of the curves that points up."""
    guides: IntArray
    """Indices of the cache's guides with weights of their own of 1."""
    curves: IntArray
    """The curve of each."""
    inputs: dict[str, set[str]]
    """Checksums of the files of curves that the bake read, by name."""


def goal(cache: Cache, anim: Path, frames: Container[int] | None = None) -> Iterator[Finding]:
    """Compares guides with the curves of the animation `anim`, at the frames of the shot among `frames`."""
    curves = next((c for c in cache.curves if c.path == GUIDES and c.consistent), None)
    if curves is None:
        yield Finding(GOAL, message="the cache holds no guides to compare")
        return
    text = anim.read_bytes()
    if digest(text) not in set().union(*checksums(cache, "anim").values()):
        yield Finding(GOAL, message=f"{anim.name} is not the animation of this bake")
        return
    try:
        content = overridden(json.loads(text), cache.record.get("settings", {}).get("set", {}))
        goals = list(goals_of(cache, content, anim.parent))
    except (CacheError, KeyError, IndexError, TypeError, ValueError) as error:
        yield Finding(GOAL, message=f"the goals of {anim.name} are not those of this bake: {error}")
        return
    skins = Skins(cache)
    for frame in cache.frames[1:-1]:
        if frames is not None and frame not in frames:
            continue
        try:
            values = read_frame(cache, frame).values
            for found in goals:
                yield from at_frame(cache, curves, skins, found, frame, values)
        except (CacheError, OSError, ValueError) as error:
            yield Finding(GOAL, message=str(error), frame=frame)


def digest(content: bytes) -> str:
    """The checksum of a file in the manifest."""
    return hashlib.sha256(content).hexdigest()


def checksums(cache: Cache, role: str) -> dict[str, set[str]]:
    """Checksums of the inputs of one role, by file name."""
    found: dict[str, set[str]] = {}
    for entry in cache.record.get("inputs", ()):
        if entry.get("role") == role:
            found.setdefault(str(entry.get("file")), set()).add(str(entry.get("sha256")))
    return found


def overridden(content: dict[str, Any], values: dict[str, Any]) -> dict[str, Any]:
    """An animation with the values that the bake was given in place of those of the file.

    Keys are such as `anim.goals[0].hard_to`.
    """
    for key, value in values.items():
        file, *path = re.findall(r"[^.\[\]]+", key)
        if file != "anim":
            continue
        place: Any = content
        for name in path[:-1]:
            place = place[int(name)] if isinstance(place, list) else place.setdefault(name, {})
        place[int(path[-1]) if isinstance(place, list) else path[-1]] = value
    return content


def goals_of(cache: Cache, content: dict[str, Any], folder: Path) -> Iterator[Goal]:
    """The goals of an animation, with the guides that the manifest names."""
    ids = np.array(attribute_value(cache, GUIDES, "primvars:groom_id"), int)
    place = {int(number): k for k, number in enumerate(ids)}
    recorded = cache.record.get("scene_figures", {}).get("goals", ())
    for file, record in zip(content.get("goals", ()), recorded, strict=True):
        led = [
            (place[number], curve)
            for curve, (number, weight) in enumerate(zip(record["guides"], record["weights"], strict=True))
            if weight == 1 and number in place
        ]
        pairs = np.array(led, int).reshape(-1, 2)
        unit, up = (
            file.get(key, content.get(key, default))
            for key, default in (("metres_per_unit", 1.0), ("up_axis", "y"))
        )
        yield Goal(file, folder, unit, up, pairs[:, 0], pairs[:, 1], checksums(cache, "goal"))


def at_frame(
    cache: Cache,
    curves: Curves,
    skins: Skins,
    found: Goal,
    frame: int,
    values: dict[str, Array],
) -> Iterator[Finding]:
    """The finding of a goal at a frame, if it holds any guide there."""
    span = (frame - SETTLED / found.file.get("hz", 4.0) * cache.fps, float(frame))
    if not len(found.guides) or least(found.file.get("weight", 1.0), span) < 1:
        return
    hard = least(found.file.get("hard_to", 0.0), span)
    along = found.file.get("along", {"arc": [0], "values": [0.0 if "hard_to" in found.file else 1.0]})
    points = values[f"{GUIDES}.points"].astype(float)
    path = sequence_path(found.folder, found.file["sequence"], frame)
    if digest(path.read_bytes()) not in found.inputs.get(path.name, ()):
        yield Finding(GOAL, message=f"{path.name} is not the file of this bake", frame=frame)
        return
    stage_up = str(UsdGeom.GetStageUpAxis(cache.stage)).lower()
    led = read_curves(path)
    turn = None
    if found.file.get("space", "world") == "rest":
        turn = turns(cache, curves, skins, values)
    apart = np.zeros(len(found.guides))
    for k, (guide, curve) in enumerate(zip(found.guides, found.curves, strict=True)):
        start = curves.starts[guide]
        own = points[start : start + curves.counts[guide]] * cache.metres_per_unit
        place = to_axis(led[curve] * found.unit, found.up, stage_up)
        place = place - place[0]
        if turn is not None:
            place = place @ turn[guide]
        arc = along_curve(refined(own), len(own))
        full = full_until(hard, along)
        if full == 0:
            continue
        measured = arc <= arc[-1] * (1.0 if full >= 1 else NEAR * full)
        target = at_arc(refined(place), arc[measured])
        apart[k] = norms(own[measured] - own[0] - target).mean() / arc[-1]
    worst = int(apart.argmax())
    value = float(np.percentile(apart, 95))
    yield Finding(GOAL, value, frame=frame, prim=GUIDES, curve=int(found.guides[worst]))


def least(keys: Any, span: tuple[float, float]) -> float:
    """The least value of a number over time, which is monotonic between keys, in a span of frames."""
    if isinstance(keys, int | float):
        return float(keys)
    frames, values = np.array(keys["frames"], float), np.array(keys["values"], float)
    first = max(0, int(np.searchsorted(frames, span[0], "right")) - 1)
    last = min(len(frames) - 1, int(np.searchsorted(frames, span[1], "left")))
    return float(values[first : last + 1].min())


def full_until(hard: float, along: dict[str, Any]) -> float:
    """Share of the length from the root up to which the weight along the strand is 1."""
    arc, values = np.array(along["arc"], float), np.array(along["values"], float)
    # Between two keys of 1, and before the first and after the last, it is constant.
    until = 0.0
    if values[0] == 1:
        below = np.flatnonzero(values < 1)
        until = 1.0 if not len(below) else float(arc[below[0] - 1])
    return min(1.0, max(until, hard))


def sequence_path(folder: Path, pattern: str, frame: int) -> Path:
    """The file of a frame in a sequence such as `tail.####.obj`."""
    digits = pattern.count("#")
    return folder / pattern.replace("#" * digits, f"{frame:0{digits}d}")


def read_curves(path: Path) -> list[FloatArray]:
    """The elements `l` of an OBJ file."""
    vertices: list[list[float]] = []
    curves: list[FloatArray] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        words = line.split()
        if words and words[0] == "v":
            vertices.append([float(word) for word in words[1:4]])
        elif words and words[0] == "l":
            numbers = [int(word.split("/")[0]) for word in words[1:]]
            curves.append(np.array([vertices[n - 1 if n > 0 else n] for n in numbers]))
    return curves


def to_axis(points: FloatArray, up: str, wanted: str) -> FloatArray:
    """Points with another axis up, y or z."""
    if up == wanted:
        return points
    x, y, z = points.T
    return np.stack([x, z, -y] if up == "z" else [x, -z, y], axis=1)


def turns(cache: Cache, curves: Curves, skins: Skins, values: dict[str, Array]) -> FloatArray:
    """Rotations from rest to the world that carry the root of each guide, for row vectors.

    Raises:
        CacheError: What carries the roots is not in the frame.
    """
    if skins:
        motion = skins.carry(curves, lambda path, name: values.get(f"{path}.{name}"))
        if motion is None:
            raise CacheError("the skins are not in the frame")
        return motion[0]
    head = values.get(f"{HEAD}.{TRANSFORM}")
    if head is None:
        raise CacheError("the head is not in the frame")
    return np.broadcast_to(head[:3, :3], (len(curves.counts), 3, 3))


def refined(points: FloatArray) -> FloatArray:
    """A smooth curve through points, at `FINE` points a segment: cubics with the slopes of parabolas."""
    length = np.maximum(norms(np.diff(points, axis=0)), 1e-12)
    t = np.concatenate([[0], np.cumsum(length)])
    slope = np.gradient(points, t, axis=0, edge_order=2 if len(points) > 2 else 1)
    u = np.linspace(0, 1, FINE, endpoint=False)[None, :, None]
    a, b = points[:-1, None], points[1:, None]
    da, db = (slope[:-1] * length[:, None])[:, None], (slope[1:] * length[:, None])[:, None]
    step = u * u * (3 - 2 * u)
    inner = a + (b - a) * step + da * u * (1 - u) ** 2 - db * u * u * (1 - u)
    fine: FloatArray = np.concatenate([inner.reshape(-1, 3), points[-1:]])
    return fine


def along_curve(fine: FloatArray, count: int) -> FloatArray:
    """Arc length at each of the `count` points that `refined` went through."""
    arc = np.concatenate([[0], np.cumsum(norms(np.diff(fine, axis=0)))])
    return arc[:: (len(fine) - 1) // (count - 1)]


def at_arc(fine: FloatArray, arc: FloatArray) -> FloatArray:
    """Points of a curve at arc lengths; its last tangent continues it."""
    own = np.concatenate([[0], np.cumsum(norms(np.diff(fine, axis=0)))])
    place = np.stack([np.interp(arc, own, fine[:, axis]) for axis in range(3)], axis=1)
    tangent = (fine[-1] - fine[-2]) / np.linalg.norm(fine[-1] - fine[-2])
    beyond: FloatArray = place + np.maximum(arc - own[-1], 0)[:, None] * tangent
    return beyond
