"""Reading a cache."""

import numpy as np
import pytest

from hairbake_validate.cache import Cache, CacheError, read_frame
from validator.good_cache import CacheBuilder


def test_reads_what_was_written(good_cache: CacheBuilder) -> None:
    cache = Cache(good_cache.directory)
    assert list(cache.frames) == list(range(1000, 1008))
    assert [curves.path for curves in cache.curves] == ["/groom/hair", "/groom/guides"]
    assert all(curves.consistent for curves in cache.curves)
    assert len(cache.colliders[0].triangles) == 168
    frame = read_frame(cache, 1003)
    assert sorted(frame.values) == sorted(cache.animated())
    assert frame.times["/groom/hair.points"] == cache.sample_times(1003) == [1003.0, 1003.25, 1003.5]
    assert [sorted(values) for values in frame.later.values()] == [sorted(cache.animated())] * 2
    assert frame.values["/groom/head.xformOp:transform"].shape == (4, 4)
    assert frame.values["/groom/hair.points"].dtype == np.float32


@pytest.mark.parametrize("name", ["hair.usda", "manifest.json"])
def test_error_names_the_missing_file(good_cache: CacheBuilder, name: str) -> None:
    good_cache.path(name).unlink()
    with pytest.raises(CacheError, match=name):
        Cache(good_cache.directory)
