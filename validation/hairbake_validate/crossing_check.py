"""Counts crossings in a cache: `python -m hairbake_validate.crossing_check out/`.

Between successive samples, handles included, guides are tested against each collider in the collider's own
space, and against each other and themselves in the space of the head. Bake with `--curves steps` to test
every step of the solver. Where guides divide a step that others take whole, each is tested over its own
steps: between the ends of one it moves evenly, against a collider in the collider's space, against guides in
that of the head.

A collider cannot keep out a guide that is drawn through it, and roots lie in the scalp: for each collider,
segments that pierce it at rest are excluded, and so are all between such a segment and the root. Their number
is printed.
"""

import argparse
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from .cache import ARRIVED, GUIDES, HEAD, TRANSFORM, Cache, CacheError, Curves, Mesh, read_frame
from .crossings import boxes, meeting_boxes, segments_meet_faces, strand_body, strand_strand
from .geometry import Array, BoolArray, FloatArray, IntArray, transformed

LISTED = 20
"""Crossings that are printed."""


@dataclass(frozen=True)
class Event:
    """A crossing between two samples."""

    frame: int
    """Frame of the later sample; the frame after it for a sample between frames."""
    what: str
    """Path of the collider that was crossed, or `strands`."""
    curves: tuple[int, ...]
    """Indices of the guides."""


@dataclass
class Count:
    """The pairs that were tested and the crossings that were found."""

    body_pairs: int = 0
    """Pairs of a segment and a triangle whose boxes intersect, over all intervals."""
    strand_pairs: int = 0
    """Pairs of segments of guides whose boxes intersect, over all intervals."""
    of_some: int = 0
    """Samples at which only some guides are at the end of a step."""
    excluded: int = 0
    """Pairs of a segment and a collider that are excluded."""
    events: list[Event] = field(default_factory=list)


@dataclass(frozen=True)
class Body:
    """A collider at one time."""

    corners: FloatArray
    """Corners of its triangles in its own space, `m × 3 × 3`."""
    to_world: FloatArray
    """Its own space to world, for row vectors, 4 × 4."""


@dataclass(frozen=True)
class Sample:
    """The guides, the head and the colliders at one time."""

    frame: int
    """The sample's frame; the next frame for a sample between frames."""
    time: float
    """Its time code."""
    arrived: BoolArray
    """Whether each guide is at the end of a step."""
    points: FloatArray
    """Points of the guides in world space, `N × 3`."""
    head: FloatArray
    """Space of the groom to world, for row vectors, 4 × 4."""
    bodies: list[Body]

    def local_points(self, to_world: FloatArray) -> FloatArray:
        """The points in the space that `to_world` transforms to world.

        Between samples the points move linearly in this space: a strand that rides on a turning body does not
        cross it, although its chord in world space may.
        """
        return transformed(self.points, np.linalg.inv(to_world))


def count(cache: Cache, strands: bool = True) -> Count:
    """Counts crossings of guides with colliders and, if `strands` is set, with each other and themselves."""
    guides = next(curves for curves in cache.curves if curves.path == GUIDES)
    first = guides.segments
    ends = np.stack([first, first + 1], axis=1)
    owner = guides.curve_of_point[first]
    tested = [~excluded(guides, first, mesh, rest_to_groom(cache, mesh)) for mesh in cache.colliders]
    found = Count(excluded=sum(int((~segments).sum()) for segments in tested))
    for way in ways(samples(cache)):
        found.of_some += len(way) - 2
        for before, now, own in steps(way):
            for mesh, segments, old, new in zip(
                cache.colliders, tested, before.bodies, now.bodies, strict=True
            ):
                moved = segments & own[owner]
                start = before.local_points(old.to_world)[ends[moved]]
                end = now.local_points(new.to_world)[ends[moved]]
                hit = strand_body(start, end, old.corners, new.corners)
                found.body_pairs += hit.tested
                crossed = np.unique(owner[moved][hit.pairs[:, 0]])
                found.events += [Event(now.frame, mesh.path, (int(curve),)) for curve in crossed]
        if strands:
            points = points_in_head(way, guides.curve_of_point)
            for (start, end), now in zip(pairwise(points), way[1:], strict=True):
                hit = strand_strand(start[ends], end[ends], owner)
                found.strand_pairs += hit.tested
                met = np.unique(np.sort(owner[hit.pairs], axis=1), axis=0)
                found.events += [Event(now.frame, "strands", (int(a), int(b))) for a, b in met]
    return found


def ways(all_samples: Iterable[Sample]) -> Iterator[list[Sample]]:
    """The ways between successive samples at which all guides have arrived, both ends included."""
    way: list[Sample] = []
    for now in all_samples:
        way.append(now)
        if now.arrived.all():
            if len(way) > 1:
                yield way
            way = [now]
    if len(way) > 1:
        raise CacheError("damaged: some guides have not arrived at the last frame")


def steps(way: list[Sample]) -> Iterator[tuple[Sample, Sample, BoolArray]]:
    """The steps of the guides on a way: the samples at both ends, and the guides that took it."""
    last = np.zeros(len(way[0].arrived), int)
    for i, now in enumerate(way[1:], 1):
        for start in np.unique(last[now.arrived]):
            yield way[start], now, now.arrived & (last == start)
        last[now.arrived] = i


def points_in_head(way: list[Sample], curve_of_point: IntArray) -> list[FloatArray]:
    """The points at each sample of a way in the space of the head: evenly between the ends of a step."""
    points = [now.local_points(now.head) for now in way]
    if len(way) > 2:
        times = np.array([now.time for now in way])
        arrived = np.array([now.arrived for now in way])
        for guide in np.flatnonzero(~arrived.all(axis=0)):
            here, at = curve_of_point == guide, np.flatnonzero(arrived[:, guide])
            for i in np.flatnonzero(~arrived[:, guide]):
                before, after = at[at < i][-1], at[at > i][0]
                share = (times[i] - times[before]) / (times[after] - times[before])
                points[i][here] = (1 - share) * points[before][here] + share * points[after][here]
    return points


def samples(cache: Cache) -> Iterator[Sample]:
    """All samples of the cache, from the first handle frame to the last."""
    for frame in cache.frames:
        file = read_frame(cache, frame)
        yield sample(cache, frame, frame, file.values)
        if frame != cache.frames[-1]:
            for time, values in sorted(file.later.items()):
                yield sample(cache, frame + 1, time, values)


def sample(cache: Cache, frame: int, time: float, values: dict[str, Array]) -> Sample:
    """The sample with these attribute values."""
    bodies = []
    for mesh in cache.colliders:
        points = values[f"{mesh.path}.points"].astype(float) if mesh.deforms else mesh.points
        bodies.append(Body(points[mesh.triangles], values[f"{mesh.path}.{TRANSFORM}"]))
    points, head = values[f"{GUIDES}.points"].astype(float), values[f"{HEAD}.{TRANSFORM}"]
    guides = next(curves for curves in cache.curves if curves.path == GUIDES)
    arrived = values.get(f"{GUIDES}.{ARRIVED}", np.ones(len(guides.counts)))
    return Sample(frame, time, arrived != 0, points, head, bodies)


def rest_to_groom(cache: Cache, mesh: Mesh) -> FloatArray:
    """A collider's own space to that of the groom, in the first sample; identity if it rides on the head."""
    values = read_frame(cache, cache.first - 1).values
    matrix: FloatArray = values[f"{mesh.path}.{TRANSFORM}"] @ np.linalg.inv(values[f"{HEAD}.{TRANSFORM}"])
    return matrix


def excluded(curves: Curves, first: IntArray, mesh: Mesh, to_groom: FloatArray) -> BoolArray:
    """Segments that pierce the mesh at rest, and those from the root to the first of them.

    `first` is the first point of each segment.
    """
    rest = curves.rest.astype(float)
    ends = rest[np.stack([first, first + 1], axis=1)]
    corners = transformed(mesh.points, to_groom)[mesh.triangles]
    pairs = meeting_boxes(*boxes(ends, ends), *boxes(corners, corners))
    pierced = segments_meet_faces(ends[pairs[:, 0]], corners[pairs[:, 1]])
    piercing = np.zeros(len(first), bool)
    piercing[pairs[pierced, 0]] = True
    out = piercing.copy()
    owner = curves.curve_of_point[first]
    for curve in np.unique(owner[piercing]):
        segments = np.flatnonzero(owner == curve)
        out[segments[: int(np.argmax(piercing[segments])) + 1]] = True
    return out


def main(arguments: list[str] | None = None) -> int:
    """Prints the crossings. Exit code: 0 for none, 1 for some, 2 if the cache cannot be read."""
    parser = argparse.ArgumentParser(
        prog="python -m hairbake_validate.crossing_check",
        description="Count crossings of guides with colliders and guides, between a cache's samples.",
    )
    parser.add_argument("cache", type=Path, help="folder of the cache")
    parser.add_argument("--bodies-only", action="store_true", help="do not test guides against each other")
    options = parser.parse_args(arguments)
    try:
        found = count(Cache(options.cache), not options.bodies_only)
    except CacheError as error:
        print(f"crossing_check: {error}", file=sys.stderr)
        return 2
    print(
        f"tested {found.body_pairs} segment-triangle pairs and {found.strand_pairs} segment-segment pairs, "
        f"excluded {found.excluded} segments drawn through a collider: {len(found.events)} crossings"
    )
    for event in found.events[:LISTED]:
        print(f"  frame {event.frame}: {event.what}, guides {', '.join(map(str, event.curves))}")
    if len(found.events) > LISTED:
        print(f"  and {len(found.events) - LISTED} more")
    return 1 if found.events else 0


if __name__ == "__main__":
    sys.exit(main())
