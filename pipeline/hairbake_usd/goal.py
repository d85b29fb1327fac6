"""Curves of a stage over time, which guides are pulled to."""

import numpy as np
from pxr import Usd, UsdGeom

from .errors import input_error
from .exchange import Array, Arrays, FloatArray, Header, IntArray
from .groom import read_controls
from .mesh import Times
from .primvars import GUIDES, IDS, Primvars
from .roles import roles
from .stage import all_of, apply, composition_notes, convention, find, gather, open_stage, to_world


def read(path: str, prim_path: str | None, times: Times) -> tuple[Header, Arrays]:
    """Header and arrays of the curves at and below a prim, in world space: of guides, if there are any.

    `counts` are the points of each curve, `points` those of all curves at each of the times, and `id` the
    ids of the curves, if all prims have them. `span` holds the first and the last time code at which the
    stage has points of each curve, if there are several, else infinities. `rate` in the header is the number
    of time codes per second.

    Raises:
        InputErrors: All errors in the curves.
    """
    stage = open_stage(path)
    header = convention(stage)
    prims = all_of(find(stage, prim_path), UsdGeom.BasisCurves, "BasisCurves")
    found = roles(prims)
    notes = composition_notes(stage)
    parts = gather(prims, lambda prim: read_prim(prim, times, notes))
    guides = [
        np.full(len(part.counts), role.guides) if part.guide is None else part.guide != 0
        for part, role in zip(parts, found, strict=True)
    ]
    kept = guides if any(guide.any() for guide in guides) else [np.full(len(guide), True) for guide in guides]
    read_from = [str(prim.GetPath()) for prim, keep in zip(prims, kept, strict=True) if keep.any()]
    notes.append(f"curves of {', '.join(read_from)}")
    parts = [part.only(keep) for part, keep in zip(parts, kept, strict=True) if keep.any()]
    arrays: Arrays = {
        "counts": ("u32", np.concatenate([part.counts for part in parts])),
        "points": ("f64", np.concatenate([part.points for part in parts], axis=1)),
    }
    ids = [part.ids for part in parts if part.ids is not None]
    if len(ids) == len(parts):
        arrays["id"] = ("i32", np.concatenate(ids))
    spans = [part.span for part in parts for _ in part.counts]
    arrays["span"] = ("f64", np.array(spans, float).reshape(-1, 2))
    return {**header, "notes": notes, "rate": stage.GetTimeCodesPerSecond()}, arrays


class MovingCurves:
    """The curves of one prim at several times."""

    def __init__(
        self,
        counts: IntArray,
        points: FloatArray,
        ids: IntArray | None,
        guide: Array | None,
        span: tuple[float, float],
    ) -> None:
        """`counts` are the points of each curve; `points`, `times × N × 3`, are in world space.

        `span` holds the first and the last time code at which the stage has points, if there are several.
        """
        self.counts, self.points, self.ids, self.guide, self.span = counts, points, ids, guide, span

    def only(self, keep: Array) -> "MovingCurves":
        """The curves where `keep` is true."""
        of_points = np.repeat(keep, self.counts)
        ids = None if self.ids is None else self.ids[keep]
        return MovingCurves(self.counts[keep], self.points[:, of_points], ids, None, self.span)


def read_prim(prim: Usd.Prim, times: Times, notes: list[str]) -> MovingCurves:
    """The curves of one prim.

    Raises:
        InputErrors: The errors of the prim; curves that change in number, or in their numbers of points.
    """
    first = ids = guide = None
    samples = []
    for code in times.codes():
        at, layout, points = read_controls(prim, code, notes)
        if first is None:
            first = layout
            primvars = Primvars(prim, layout, at, notes)
            ids, guide = primvars.root(IDS, int), primvars.root(GUIDES, int)
        if not np.array_equal(layout.counts, first.counts):
            raise input_error(
                f"{prim.GetPath()}.curveVertexCounts",
                f"changes between the time codes {times.start:g} and {code:g}",
                "the same number of points in each curve at all times",
                "export curves with constant topology",
            )
        if not np.isfinite(points).all():
            bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
            message = f"point {bad} is not finite at time code {code:g}"
            help = "export the curves again"
            raise input_error(f"{prim.GetPath()}.points", message, "finite numbers", help)
        counts, evaluated = layout.type.evaluate(layout.counts, points)
        samples.append(apply(to_world(prim, at), evaluated))
    codes = UsdGeom.BasisCurves(prim).GetPointsAttr().GetTimeSamples()
    span = (codes[0], codes[-1]) if len(codes) > 1 else (-np.inf, np.inf)
    return MovingCurves(counts, np.stack(samples), ids, guide, span)
