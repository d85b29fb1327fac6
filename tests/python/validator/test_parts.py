"""A validation divided into parts, as on a farm, finds what an undivided one finds."""

from hairbake_validate.__main__ import frame_list
from hairbake_validate.run import validate
from validator.file_defects import static_layer_changed
from validator.frame_defects import stretched_guide
from validator.good_cache import CacheBuilder
from validator.motion_defects import one_frame_jump


def test_parts_together_find_what_the_whole_finds(good_cache: CacheBuilder) -> None:
    one_frame_jump(good_cache)
    stretched_guide(good_cache)
    static_layer_changed(good_cache)
    parts = [validate(good_cache.directory, only="static")]
    parts += [
        validate(good_cache.directory, frame_list(frames), only="moving")
        for frames in ("1000-1002", "1003", "1004-1007")
    ]
    whole = validate(good_cache.directory)
    assert not whole.passed
    for check, outcome in whole.outcomes.items():
        found = [part.outcomes[check] for part in parts if part.outcomes[check].ran]
        assert len(found) in ((1, 3) if outcome.ran else (0,))
        assert [finding for part in found for finding in part.broken] == outcome.broken


def test_frame_lists() -> None:
    assert frame_list("1001-1010x4, 1002") == {1001, 1002, 1005, 1009}
    assert frame_list("-9--1:4,7") == {-9, -5, -1, 7}
