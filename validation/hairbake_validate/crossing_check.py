"""Crossings of a written cache: `python -m hairbake_validate.crossing_check out/`.

Looks at the guides between successive samples, handles included, against a body in its own space and against each other in that of the head; bake with
`--curves steps` to look at every step of the solver. Ends with 1 where something crossed.

What is drawn through a body cannot be kept out of it, and a root stands in the scalp: a segment that pierces a body at
rest, and all between it and the root, are left out for that body. How many these are is told.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .cache import GUIDES, HEAD, TRANSFORM, Cache, Curves, Mesh, Unreadable, read_frame
from .crossings import boxes, meeting_boxes, segments_meet_faces, strand_body, strand_strand
from .geometry import transformed


@dataclass(frozen=True)
class Event:
    """Two things passed through each other between two frames."""

    frame: int
    """The later of the two, or that on the way to which it was."""
    what: str
    curves: tuple[int, ...]
    """Curves by index."""


@dataclass
class Count:
    """What was looked at, and what was found."""

    body_pairs: int = 0
    """Pairs of a segment and a triangle whose boxes meet, over all intervals."""
    strand_pairs: int = 0
    """The same of segments of two strands."""
    left_out: int = 0
    """Pairs of a segment and a body that are left out."""
    events: list[Event] | None = None


def count(cache: Cache, strands: bool = True) -> Count:
    """Counts crossings of guides with colliders and, if `strands`, with each other."""
    curves = next(c for c in cache.curves if c.path == GUIDES)
    first = curves.segments
    owner = curves.curve_of_point[first]
    free = [~exempt(curves, first, mesh, rest_transform(cache, mesh)) for mesh in cache.colliders]
    found = Count(left_out=sum(int((~f).sum()) for f in free), events=[])
    ends = np.stack([first, first + 1], axis=1)
    before = None
    for now in moments(cache):
        if before is not None:
            frame = now.frame
            for mesh, watched, old, new in zip(cache.colliders, free, before.bodies, now.bodies):
                start, end = (m.seen_from(b.place)[ends[watched]] for m, b in ((before, old), (now, new)))
                hit = strand_body(start, end, old.corners, new.corners)
                found.body_pairs += hit.tested
                crossed = np.unique(owner[watched][hit.pairs[:, 0]])
                found.events += [Event(frame, mesh.path, (int(c),)) for c in crossed]
            if strands:
                start, end = (m.seen_from(m.head)[ends] for m in (before, now))
                hit = strand_strand(start, end, owner)
                found.strand_pairs += hit.tested
                met = np.unique(np.sort(owner[hit.pairs], axis=1), axis=0)
                found.events += [Event(frame, "strands", (int(a), int(b))) for a, b in met]
        before = now
    return found


@dataclass(frozen=True)
class Body:
    """A collider at one moment."""

    corners: np.ndarray
    """Of its triangles, `m × 3 × 3`, in its own space."""
    place: np.ndarray
    """Its own space to the world, for row vectors."""


@dataclass(frozen=True)
class Moment:
    """A sample of the cache."""

    frame: int
    """Its own, or the one that it is on the way to."""
    points: np.ndarray
    """Of the guides, world."""
    head: np.ndarray
    """Space of the groom to the world."""
    bodies: list[Body]

    def seen_from(self, place: np.ndarray) -> np.ndarray:
        """The points in the space that `place` takes to the world. Between samples they are taken to move linearly there: a strand that
        rides on a body that turns goes through nothing, though the chord of its way in the world may.
        """
        return transformed(self.points, np.linalg.inv(place))


def moments(cache: Cache) -> Iterator[Moment]:
    """All samples, handles included."""
    for frame in cache.frames:
        file = read_frame(cache, frame)
        yield moment(cache, frame, file.values)
        if frame != cache.frames[-1]:
            for _, values in sorted(file.later.items()):
                yield moment(cache, frame + 1, values)


def moment(cache: Cache, frame: int, values: dict[str, np.ndarray]) -> Moment:
    """Of these values."""
    bodies = []
    for mesh in cache.colliders:
        points = values[f"{mesh.path}.points"].astype(float) if mesh.deforms else mesh.points
        bodies.append(Body(points[mesh.triangles], values[f"{mesh.path}.{TRANSFORM}"]))
    return Moment(frame, values[f"{GUIDES}.points"].astype(float), values[f"{HEAD}.{TRANSFORM}"], bodies)


def rest_transform(cache: Cache, mesh: Mesh) -> np.ndarray:
    """Takes a collider's rest space to that of the groom, as both stand in the first sample: where it rides on the head, none."""
    values = read_frame(cache, cache.first - 1).values
    return values[f"{mesh.path}.{TRANSFORM}"] @ np.linalg.inv(values[f"{HEAD}.{TRANSFORM}"])


def exempt(curves: Curves, first: np.ndarray, mesh: Mesh, to_groom: np.ndarray) -> np.ndarray:
    """Whether each segment pierces the mesh at rest or lies between the root and the first stretch that does so."""
    rest = curves.rest.astype(float)
    ends = rest[np.stack([first, first + 1], axis=1)]
    corners = transformed(mesh.points, to_groom)[mesh.triangles]
    pairs = meeting_boxes(*boxes(ends, ends), *boxes(corners, corners))
    pierced = segments_meet_faces(ends[pairs[:, 0]], corners[pairs[:, 1]])
    through = np.zeros(len(first), bool)
    through[pairs[pierced, 0]] = True
    # From the root to the end of the first run of such segments.
    out = through.copy()
    owner = curves.curve_of_point[first]
    for curve in np.unique(owner[through]):
        mine = np.flatnonzero(owner == curve)
        out[mine[: int(np.argmax(through[mine])) + 1]] = True
    return out


def main(arguments: list[str] | None = None) -> int:
    """Prints what was found; 0 where nothing crossed, 1 where something did, 2 without a readable cache."""
    parser = argparse.ArgumentParser(
        prog="crossing_check", description="Counts crossings in a cache, between its samples."
    )
    parser.add_argument("cache", type=Path)
    parser.add_argument("--bodies-only", action="store_true", help="strands may pass through each other")
    options = parser.parse_args(arguments)
    try:
        found = count(Cache(options.cache), not options.bodies_only)
    except Unreadable as error:
        print(error, file=sys.stderr)
        return 2
    print(
        f"{found.body_pairs} pairs of segment and triangle, {found.strand_pairs} of two segments looked at; "
        f"{found.left_out} segments drawn through a body left out; {len(found.events)} crossings"
    )
    for event in found.events[:20]:
        print(f"  frame {event.frame}: {event.what}, guides {', '.join(map(str, event.curves))}")
    return 1 if found.events else 0


if __name__ == "__main__":
    sys.exit(main())
