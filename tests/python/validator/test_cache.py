"""Reading a cache."""

import numpy as np
import pytest

from hairbake_validate.cache import Cache, Unreadable, read_frame


def test_reads_what_was_written(good_cache):
    cache = Cache(good_cache.directory)
    assert list(cache.frames) == list(range(1000, 1008))
    assert [curves.path for curves in cache.curves] == ["/groom/hair", "/groom/guides"]
    assert all(curves.sound for curves in cache.curves)
    assert len(cache.colliders[0].triangles) == 168
    frame = read_frame(cache, 1003)
    assert sorted(frame.values) == sorted(cache.animated())
    assert frame.times["/groom/hair.points"] == cache.moments(1003) == [1003.0, 1003.25, 1003.5]
    assert [sorted(values) for values in frame.later.values()] == [sorted(cache.animated())] * 2
    assert frame.values["/groom/head.xformOp:transform"].shape == (4, 4)
    assert frame.values["/groom/hair.points"].dtype == np.float32


@pytest.mark.parametrize("name", ["hair.usda", "manifest.json"])
def test_says_what_is_missing(good_cache, name):
    good_cache.path(name).unlink()
    with pytest.raises(Unreadable, match=name):
        Cache(good_cache.directory)
