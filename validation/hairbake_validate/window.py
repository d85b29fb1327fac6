"""A frame with its neighbours, and the reference that all frames are compared with."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from . import tolerances
from .cache import (
    ACCELERATIONS,
    ARRIVED,
    CLAMPS,
    GUIDES,
    GUIDES_PER_STRAND,
    HAIR,
    HEAD,
    HELD,
    LEVEL,
    NORMALS,
    TIES,
    TRANSFORM,
    Cache,
    CacheError,
    Curves,
    FrameFile,
    Mesh,
    attribute_value,
    read_frame,
    read_value,
)
from .collider import Collider
from .geometry import Arcs, Array, BoolArray, FloatArray, IntArray, arc_lengths, transformed
from .skins import Skins

_Result = TypeVar("_Result")


@dataclass
class Reference:
    """Data of the rest pose and the first frame. Computed once and sent to every process."""

    rest_arcs: Arcs | None = None
    """Arcs of the guides at rest."""
    colliders: list[tuple[Mesh, Collider]] = field(default_factory=list)
    """Colliders in the first frame; valid in all frames unless the mesh deforms."""
    outside: dict[tuple[str, str], BoolArray] = field(default_factory=dict)
    """Points that must stay outside a collider, by the paths of curves and collider.

    These are the points outside it in rest space, where the groom is drawn; and, because a prop may be
    anywhere at rest, those that are outside in the first frame, both as written and as drawn. A guide that is
    drawn through a collider may slide in it: for guides, the points next to such a stretch are excluded too.
    """

    skins: Skins | None = None
    """The skins that carry the roots; empty if the head carries them."""
    followed: IntArray | None = None
    """Indices of the guides that each render strand follows, `n × 3`; None if they are not in the cache."""

    @classmethod
    def of(cls, cache: Cache) -> "Reference":
        """Computes the reference from the static layers and the first frame that can be read."""
        reference = cls(followed=followed_guides(cache), skins=Skins(cache))
        usable = [curves for curves in cache.curves if curves.consistent]
        for curves in usable:
            if curves.path == GUIDES:
                reference.rest_arcs = arc_lengths(curves.rest, curves.counts)
        values = first_values(cache)
        head = values.get(f"{HEAD}.{TRANSFORM}")
        for mesh in cache.colliders:
            matrix = values.get(f"{mesh.path}.{TRANSFORM}")
            if head is None or matrix is None or not mesh.consistent:
                continue
            points = values.get(f"{mesh.path}.points", mesh.points)
            if points.shape != mesh.points.shape or not np.isfinite(points).all():
                continue
            collider = Collider(points.astype(float), mesh.solid)
            reference.colliders.append((mesh, collider))
            at_rest = Collider(mesh.points.astype(float), mesh.solid) if mesh.deforms else collider
            for curves in usable:
                drawn = transformed(curves.rest, head)
                if reference.skins:
                    carried = reference.skins.carried(curves, lambda path, name: values.get(f"{path}.{name}"))
                    drawn = drawn if carried is None else carried
                written = values.get(f"{curves.path}.points", drawn)
                if written.shape != drawn.shape or not np.isfinite(written).all():
                    written = drawn
                to_mesh = np.linalg.inv(matrix)
                at_first = [collider.depth(transformed(points, to_mesh)) for points in (drawn, written)]
                outside = (at_rest.depth(curves.rest.astype(float)) == 0) | (np.maximum(*at_first) == 0)
                if curves.path == GUIDES:
                    outside &= ~neighbours_on_curve(inside_after_exit(outside, curves), curves)
                reference.outside[curves.path, mesh.path] = outside
        return reference


def followed_guides(cache: Cache) -> IntArray | None:
    """Indices of the guides that each render strand follows; None if any of them is unknown."""
    known = np.array(attribute_value(cache, GUIDES, "primvars:groom_id"), int)
    named = np.array(attribute_value(cache, HAIR, "primvars:groom_closest_guides"), int)
    hair = next((curves for curves in cache.curves if curves.path == HAIR), None)
    guides = next((curves for curves in cache.curves if curves.path == GUIDES), None)
    if hair is None or guides is None or not hair.consistent or not guides.consistent:
        return None
    if len(known) != len(guides.counts) or len(named) != GUIDES_PER_STRAND * len(hair.counts):
        return None
    order = np.argsort(known)
    place = np.searchsorted(known, named, sorter=order)
    index: IntArray = order[np.minimum(place, len(known) - 1)]
    return index.reshape(-1, GUIDES_PER_STRAND) if (known[index] == named).all() else None


def inside_after_exit(outside: BoolArray, curves: Curves) -> BoolArray:
    """Marks inside points that follow an outside point of their curve: the curve re-enters the collider."""
    exits = np.cumsum(outside)
    before: IntArray = (exits - outside)[curves.starts]
    marked: BoolArray = ~outside & (exits > np.repeat(before, curves.counts))
    return marked


def neighbours_on_curve(points: BoolArray, curves: Curves) -> BoolArray:
    """Marks the neighbours of marked points on their curves."""
    neighbours = np.zeros(len(points), bool)
    first = curves.segments
    neighbours[first] |= points[first + 1]
    neighbours[first + 1] |= points[first]
    return neighbours


def first_values(cache: Cache) -> dict[str, Array]:
    """Animated values of the first frame whose file can be read."""
    for frame in cache.frames:
        try:
            return read_frame(cache, frame).values
        except CacheError:
            continue
    return {}


class Window:
    """The frames around `frame`. Files are read on demand and kept while they are within two frames."""

    def __init__(self, cache: Cache, reference: Reference) -> None:
        """A window at the first frame of the cache."""
        self.cache = cache
        self.reference = reference
        self.frame = cache.frames[0]
        self._files: dict[int, FrameFile | str] = {}  # The error message if a file cannot be read.
        self._heads: dict[int, Array | None] = {}
        self._results: dict[int, dict[Any, Any]] = {}  # What several checks or frames need, by frame.
        self._shapes = expected_shapes(cache)

    def move_to(self, frame: int) -> None:
        """Centres the window on `frame`."""
        self.frame = frame
        self._files = {number: file for number, file in self._files.items() if abs(number - frame) <= 2}
        self._results = {number: kept for number, kept in self._results.items() if abs(number - frame) <= 2}

    def bodies(self) -> list[str]:
        """Paths of the head and the colliders."""
        return [HEAD, *(mesh.path for mesh in self.cache.colliders)]

    def shape(self, path: str) -> tuple[int, ...] | None:
        """Shape that the topology requires of an attribute's value; None if it requires none."""
        return self._shapes.get(path)

    @property
    def file(self) -> FrameFile | None:
        """The centre frame's file; None if it is missing or damaged."""
        file = self._read(self.frame)
        return file if isinstance(file, FrameFile) else None

    @property
    def error(self) -> str:
        """Why the centre frame's file cannot be read; empty if it can."""
        file = self._read(self.frame)
        return file if isinstance(file, str) else ""

    def all_values(self) -> list[tuple[str, Array]]:
        """Paths and values of all samples in the centre frame's file."""
        if self.file is None:
            return []
        samples = [self.file.values, *self.file.later.values()]
        return [entry for values in samples for entry in sorted(values.items())]

    def samples(self, prim: str, name: str) -> list[tuple[float, Array]]:
        """Time codes and valid values of an attribute in the centre frame's file, from the frame on."""
        path = f"{prim}.{name}"
        if self.file is None:
            return []
        samples = [(float(self.frame), self.file.values), *sorted(self.file.later.items())]
        return [(time, values[path]) for time, values in samples if self._is_valid(path, values.get(path))]

    def get(self, prim: str, name: str, offset: int = 0) -> Array | None:
        """Value of an attribute `offset` frames from the centre; None if it is missing or not valid."""
        frame = self.frame + offset
        if frame not in self.cache.frames:
            return None
        file = self._read(frame)
        path = f"{prim}.{name}"
        value = file.values.get(path) if isinstance(file, FrameFile) else None
        known = self._results.setdefault(frame, {})
        if ("valid", path) not in known:
            known["valid", path] = self._is_valid(path, value)
        return value if known["valid", path] else None

    def head(self, offset: int) -> Array | None:
        """Transform of the head `offset` frames from the centre; None if there is none or it is not valid.

        Nothing else is read of frames that the window does not keep.
        """
        frame, path = self.frame + offset, f"{HEAD}.{TRANSFORM}"
        if frame not in self._heads:
            if frame in self._files:
                value = self.get(HEAD, TRANSFORM, offset)
            else:
                value = read_value(self.cache, frame, path) if frame in self.cache.frames else None
            self._heads[frame] = value if self._is_valid(path, value) else None
        return self._heads[frame]

    def once(
        self, compute: Callable[["Window", Curves, int], _Result], curves: Curves, offset: int = 0
    ) -> _Result:
        """`compute(window, curves, offset)`, once a frame: checks and neighbouring frames share it."""
        known = self._results.setdefault(self.frame + offset, {})
        key = (compute.__name__, curves.path)
        if key not in known:
            known[key] = compute(self, curves, offset)
        result: _Result = known[key]
        return result

    def keep(self, key: str, offset: int, compute: Callable[[int], _Result]) -> _Result:
        """`compute(frame)` of a frame `offset` from the centre, once while the window is near."""
        known = self._results.setdefault(self.frame + offset, {})
        if key not in known:
            known[key] = compute(self.frame + offset)
        result: _Result = known[key]
        return result

    def depths(self, mesh: Mesh, at_first: Collider) -> dict[str, FloatArray]:
        """Depth in a collider of each curve's points in the centre frame, by the path of the curves.

        0 for points that need not stay outside. `at_first` is the collider in the first frame. Empty without
        valid points or transform of the mesh.
        """
        known = self._results.setdefault(self.frame, {})
        if mesh.path not in known:
            known[mesh.path] = dict(self._measure_depths(mesh, at_first))
        result: dict[str, FloatArray] = known[mesh.path]
        return result

    def solid(self, mesh: Mesh, at_first: Collider) -> tuple[Collider, FloatArray] | None:
        """A collider, to ask for its surface, and its transform in the centre frame.

        `at_first` is the collider in the first frame. None without valid points or transform of the mesh.
        """
        known = self._results.setdefault(self.frame, {})
        key = ("solid", mesh.path)
        if key not in known:
            matrix = self.get(mesh.path, TRANSFORM)
            vertices = self.get(mesh.path, "points") if mesh.deforms else mesh.points
            known[key] = None
            if matrix is not None and vertices is not None:
                # The surface needs no octree.
                here = (
                    Collider(vertices.astype(float), mesh.solid, np.empty((0, 3)))
                    if mesh.deforms
                    else at_first
                )
                known[key] = here, matrix
        found: tuple[Collider, FloatArray] | None = known[key]
        return found

    def _measure_depths(self, mesh: Mesh, at_first: Collider) -> Iterator[tuple[str, FloatArray]]:
        matrix = self.get(mesh.path, TRANSFORM)
        vertices = self.get(mesh.path, "points") if mesh.deforms else mesh.points
        if matrix is None or vertices is None:
            return
        to_mesh = np.linalg.inv(matrix)
        places: dict[str, FloatArray] = {}
        for curves in self.cache.curves:
            points = self.get(curves.path, "points")
            if points is not None:
                outside = self.reference.outside[curves.path, mesh.path]
                places[curves.path] = transformed(points[outside], to_mesh)
        collider = at_first
        if mesh.deforms and places:
            queries = np.concatenate(list(places.values()))
            collider = Collider(vertices.astype(float), mesh.solid, queries)
        for path, local in places.items():
            outside = self.reference.outside[path, mesh.path]
            depth = np.zeros(len(outside))
            depth[outside] = collider.depth(local)
            # A surface that a fold has turned inside out does not tell the side.
            deep = depth * self.cache.metres_per_unit > tolerances.PINCH_DEPTH_M
            depth[deep] *= ~collider.winds_past(local[deep[outside]])
            yield path, depth

    def _is_valid(self, path: str, value: Array | None) -> bool:
        """True if the value exists, has its shape and is finite."""
        return value is not None and value.shape == self.shape(path) and bool(np.isfinite(value).all())

    def _read(self, frame: int) -> FrameFile | str:
        if frame not in self._files:
            try:
                self._files[frame] = read_frame(self.cache, frame)
            except CacheError as error:
                self._files[frame] = str(error)
        return self._files[frame]


def expected_shapes(cache: Cache) -> dict[str, tuple[int, ...]]:
    """Shape that the topology requires of each animated attribute, by path."""
    shapes: dict[str, tuple[int, ...]] = {}
    for path in (HEAD, *(mesh.path for mesh in cache.colliders)):
        shapes[f"{path}.{TRANSFORM}"] = (4, 4)
    for curves in cache.curves:
        if curves.consistent:
            for name in ("points", "velocities", ACCELERATIONS, NORMALS):
                shapes[f"{curves.path}.{name}"] = (len(curves.rest), 3)
            shapes[f"{curves.path}.extent"] = (2, 3)
            for name in (LEVEL, ARRIVED):
                shapes[f"{curves.path}.{name}"] = (len(curves.counts),)
            for name in CLAMPS:
                shapes[f"{curves.path}.{name}"] = (len(curves.counts), 3)
            ties = len(attribute_value(cache, curves.path, TIES[0]))
            for name in HELD:
                shapes[f"{curves.path}.{name}"] = (ties, 3)
    for mesh in cache.colliders:
        if mesh.deforms:
            shapes[f"{mesh.path}.points"] = mesh.points.shape
            shapes[f"{mesh.path}.extent"] = (2, 3)
    return shapes
