"""Crossing detection against brute force, and on motions with known crossings."""

import numpy as np
import pytest

from hairbake_validate.cache import Cache
from hairbake_validate.crossing_check import count, main
from hairbake_validate.crossings import cubic_roots, meeting_boxes, strand_body, strand_strand
from hairbake_validate.geometry import Array, FloatArray
from validator.defects import MIDDLE
from validator.good_cache import GUIDES, CacheBuilder


def test_cubic_roots_match_numpy() -> None:
    random = np.random.default_rng(1)
    c = random.normal(size=(2000, 4))
    c[:200, 3] = 0
    c[:50, 2] = 0
    found = cubic_roots(c)
    for row, roots in zip(c, found, strict=True):
        exact = np.roots(row[::-1])
        exact = np.sort(exact[(abs(exact.imag) < 1e-12) & (exact.real > 0) & (exact.real <= 1)].real)
        assert np.sort(roots[~np.isnan(roots)]) == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("two_sets", [False, True])
def test_grid_finds_the_pairs_of_a_brute_force_search(two_sets: bool) -> None:
    random = np.random.default_rng(2)
    low = random.uniform(0, 1, size=(300, 3))
    high = low + random.uniform(0, 0.2, size=(300, 3))
    pairs = (
        meeting_boxes(low[:100], high[:100], low[100:], high[100:]) if two_sets else meeting_boxes(low, high)
    )
    i, j = (
        np.meshgrid(np.arange(100), np.arange(100, 300), indexing="ij")
        if two_sets
        else np.triu_indices(300, 1)
    )
    i, j = i.ravel(), j.ravel()
    meet = np.all((low[i] <= high[j]) & (low[j] <= high[i]), axis=1)
    expected = {(a, b - 100 if two_sets else b) for a, b in zip(i[meet], j[meet], strict=True)}
    assert len(expected) > 50
    assert (
        len(pairs) == len(expected)
        and {tuple(sorted(p)) if not two_sets else tuple(p) for p in pairs} == expected
    )


def needle(y: float, slope: float) -> FloatArray:
    return np.array([[-0.1, y, -0.1 * slope], [0.1, y, 0.1 * slope]])


@pytest.mark.parametrize("slope", [1e3, 1.0, 1e-3, 1e-5])
def test_nearly_parallel_segments_that_swap_sides_cross(slope: float) -> None:
    still = np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]])
    owner = np.array([0, 1])
    for through, end in ((True, -3.0), (False, 0.01)):
        start = np.array([still, needle(1.0, slope)])
        stop = np.array([still, needle(end, slope)])
        hit = strand_strand(start, stop, owner)
        assert len(hit.pairs) == through, slope
        if through:
            assert hit.time == pytest.approx([0.25])


def test_strand_through_itself_crosses_where_its_segments_do_not_follow_each_other() -> None:
    root = np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]])
    between, tip = np.array([root[1], [0.0, 1.0, -0.1]]), np.array([[0.0, 1.0, -0.1], [0.0, 1.0, 0.1]])
    start = np.array([root, between, tip])
    stop = start - [0, 2, 0] * (start[:, :, 1:2] > 0)
    assert strand_strand(start, stop, np.zeros(3, int)).pairs.tolist() == [[0, 2]]


@pytest.mark.parametrize("target", ["face", "edge", "vertex"])
def test_tip_that_enters_a_mesh_crosses(target: str) -> None:
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1.0, 1, 0], [0, 1, 0], [1, 0, 0]]])
    x, y = {"face": (0.2, 0.3), "edge": (0.5, 0.5), "vertex": (1.0, 0.0)}[target]
    start = np.array([[[x, y, 1.0], [x, y, 0.5]]])
    for depth, crosses in ((0.6, True), (0.4, False)):
        hit = strand_body(start, start - [0, 0, depth], corners, corners)
        assert bool(len(hit.pairs)) == crosses
    # The triangles move instead.
    assert len(strand_body(start, start, corners, corners + [0, 0, 0.6]).pairs)


def test_moving_pairs_against_dense_sampling() -> None:
    random = np.random.default_rng(3)
    start = random.normal(size=(400, 2, 3))
    end = start + random.normal(size=(400, 2, 3))
    hit = strand_strand(start, end, np.arange(400))
    crossed = {tuple(p) for p in hit.pairs}
    # Independent reference: the sign of the volume changes between samples while the projections cross.
    seen = set()
    times = np.linspace(0, 1, 4001)
    for a, b in random.integers(0, 400, size=(3000, 2)):
        if a == b:
            continue
        p = (
            start[[a, a, b, b], [0, 1, 0, 1]]
            + times[:, None, None] * (end - start)[[a, a, b, b], [0, 1, 0, 1]]
        )
        side = np.einsum("ij,ij->i", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p[:, 3] - p[:, 0])
        for k in np.flatnonzero(side[1:] * side[:-1] < 0):
            d, e, w = p[k, 1] - p[k, 0], p[k, 3] - p[k, 2], p[k, 2] - p[k, 0]
            s, t = np.linalg.lstsq(np.stack([d, -e], axis=1), w, rcond=None)[0]
            if 0.02 < s < 0.98 and 0.02 < t < 0.98:
                seen.add((min(a, b), max(a, b)))
            elif -0.02 < s < 1.02 and -0.02 < t < 1.02:
                crossed.discard((min(a, b), max(a, b)))
        if (min(a, b), max(a, b)) in crossed:
            seen.add((min(a, b), max(a, b)))
    assert len(seen) > 50 and seen <= {tuple(p) for p in hit.pairs}


def test_good_cache_has_no_crossings_and_injected_ones_are_counted(
    good_cache: CacheBuilder, capsys: pytest.CaptureFixture[str]
) -> None:
    assert count(Cache(good_cache.directory)).events == []
    assert main([str(good_cache.directory)]) == 0

    def through(points: Array) -> Array:
        # Mirrored through the axis of the head, the tips of a guide pass through the skull.
        points = points.copy()
        points[:, [0, 2]] *= -1
        return points

    good_cache.edit_array(MIDDLE, f"{GUIDES}.points", through)
    events = count(Cache(good_cache.directory)).events
    assert {e.frame for e in events} <= {MIDDLE, MIDDLE + 1} and len(events) > 1
    assert main([str(good_cache.directory)]) == 1
    assert f"{len(events)} crossings" in capsys.readouterr().out
