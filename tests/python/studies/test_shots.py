"""A small case of the set of hard motions, and its verdicts."""

from pathlib import Path

import numpy as np
import pytest

from shots import case, grooms
from shots.motions import MOTIONS
from shots.scenes import FPS, Shot
from shots.surfaces import ellipsoid
from support import HAIRBAKE, needs_hairbake


@needs_hairbake
@pytest.mark.slow
def test_a_case_goes_through_the_pipeline_and_is_not_run_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grooms, "FUR_STRANDS", 300)
    monkeypatch.setenv("PYTHONPATH", str(Path(case.__file__).parents[1]))
    fur = grooms.make(HAIRBAKE, "fur", tmp_path / "fur")
    result = case.run(HAIRBAKE, "jump", Shot(fur, MOTIONS["jump"], 6), tmp_path / "jump")
    assert result.faults == [] and result.seconds > 0 and result.measures.guide_depth < 0.005
    assert (tmp_path / "jump/sheet.png").is_file()
    sheet = (tmp_path / "jump/sheet.png").stat()
    assert case.run(HAIRBAKE, "jump", Shot(fur, MOTIONS["jump"], 6), tmp_path / "jump") == result
    assert (tmp_path / "jump/sheet.png").stat() == sheet

    # Hair keeps its size: a head that the shot makes larger cannot be right.
    scaled = case.run(HAIRBAKE, "scaled", Shot(fur, MOTIONS["scaled"], 6), tmp_path / "scaled")
    assert "scale" in scaled.refused and scaled.faults == []


@pytest.mark.parametrize("name", MOTIONS)
def test_motions_are_rigid_and_as_fast_as_they_say(name: str) -> None:
    motion = MOTIONS[name]
    poses = np.array([motion.head(t) for t in np.arange(0, 2.5, 1 / (8 * FPS))])
    turns = poses[:, :3, :3]
    assert np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max() < 1e-12
    angles = np.arccos(np.clip((np.einsum("nij,nij->n", turns[1:], turns[:-1]) - 1) / 2, -1, 1)) * 8 * FPS
    if name.startswith("spin"):
        assert abs(angles.max() - 20) < 0.1
    if name not in ("cut", "t-pose", "capture"):
        assert angles.max() < 45


def test_grooms_stay_outside_the_bodies() -> None:
    body = ellipsoid(grooms.HEAD_CENTRE.tolist(), [0.08, 0.11, 0.1])
    for cut, _ in grooms.HEADS.values():
        bodies = [body, *grooms.TORSO.values()]
        strands = grooms.grow(body.at(grooms.scalp(20)), bodies, cut)
        assert strands.shape == (20, cut.vertices, 3)
        assert min(surface.height(strands.reshape(-1, 3)).min() for surface in bodies) > -1e-3
