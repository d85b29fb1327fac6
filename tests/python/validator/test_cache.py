"""Reading a cache."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd

from hairbake_validate.cache import Cache, CacheError, frame_file_name, read_frame
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


@pytest.mark.parametrize("frame", [-12345, -1234, -100, -99, -10, -1, 0, 9, 1001, 12345])
@pytest.mark.parametrize("stem", ["hair", "hair.over"])
def test_files_of_frames_are_named_as_clips_resolve_them(tmp_path: Path, stem: str, frame: int) -> None:
    clip = Usd.Stage.CreateNew(str(tmp_path / frame_file_name(stem, frame)))
    value = clip.DefinePrim("/groom").CreateAttribute("found", Sdf.ValueTypeNames.Double)
    value.Set(float(frame), frame)
    clip.Save()
    stage = Usd.Stage.CreateNew(str(tmp_path / "hair.usda"))
    prim = stage.DefinePrim("/groom")
    prim.CreateAttribute("found", Sdf.ValueTypeNames.Double)
    clips = Usd.ClipsAPI(prim)
    clips.SetClipTemplateAssetPath(f"./{stem}.####.usdc")
    clips.SetClipTemplateStartTime(frame)
    clips.SetClipTemplateEndTime(frame)
    clips.SetClipTemplateStride(1)
    clips.SetClipPrimPath("/groom")
    assert prim.GetAttribute("found").Get(frame) == frame


@pytest.mark.parametrize("name", ["hair.usda", "manifest.json"])
def test_error_names_the_missing_file(good_cache: CacheBuilder, name: str) -> None:
    good_cache.path(name).unlink()
    with pytest.raises(CacheError, match=name):
        Cache(good_cache.directory)
