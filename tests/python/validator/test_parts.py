"""A farm's division of the checks: all parts together find what the whole finds."""

from hairbake_validate.__main__ import frame_list
from hairbake_validate.run import validate
from validator.defects import one_frame_pop, static_layer_changed, stretched_guide


def test_parts_find_together_what_the_whole_finds(good_cache):
    one_frame_pop(good_cache)
    stretched_guide(good_cache)
    static_layer_changed(good_cache)
    parts = [validate(good_cache.directory, only="static")]
    for frames in ("1000-1002", "1003", "1004-1007"):
        parts.append(validate(good_cache.directory, frame_list(frames), only="moving"))
    whole = validate(good_cache.directory)
    assert not whole.passed
    for check, outcome in whole.outcomes.items():
        found = [part.outcomes[check] for part in parts if part.outcomes[check].ran]
        assert len(found) in (1, 3)
        assert [finding for part in found for finding in part.broken] == outcome.broken


def test_lists_of_frames():
    assert frame_list("1001-1010x4, 1002") == {1001, 1002, 1005, 1009}
    assert frame_list("-9--1:4,7") == {-9, -5, -1, 7}
