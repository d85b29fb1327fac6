"""Every defect that the validator claims to catch fails its own check, and no other."""

import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from hairbake_validate.run import CHECKS, validate
from support import ROOT
from validator import file_defects, frame_defects, motion_defects
from validator.defects import DEFECTS, MIDDLE, Defect, failed
from validator.good_cache import GUIDES, HAIR, POINTS, CacheBuilder

for module in ("stage_defects", "placement_defects"):
    import_module(f"validator.{module}")  # Registers its defects.


def test_good_cache_passes(good_cache: CacheBuilder) -> None:
    report = validate(good_cache.directory)
    assert failed(report) == set(), report.as_text()


@pytest.mark.parametrize(("checks", "inject"), DEFECTS)
def test_defect_fails_its_own_check(good_cache: CacheBuilder, checks: list[str], inject: Defect) -> None:
    inject(good_cache)
    report = validate(good_cache.directory)
    assert failed(report) == set(checks), report.as_text()
    assert report.passed == (report.outcomes[checks[0]].status == "warn")


def test_a_bend_within_a_segment_at_rest_may_straighten(good_cache: CacheBuilder) -> None:
    def shorten(stage: Usd.Stage) -> None:
        primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(GUIDES)).GetPrimvar("rest")
        rest = np.array(primvar.Get()).reshape(-1, POINTS, 3)
        rest[1, 4:] -= 0.004 * (rest[1, 4] - rest[1, 3])
        primvar.Set(Vt.Vec3fArray.FromNumpy(rest.reshape(-1, 3)))

    good_cache.edit_topology(shorten)
    report = validate(good_cache.directory)
    assert failed(report) == set(), report.as_text()


def test_every_check_has_a_defect() -> None:
    elsewhere = {"accelerations", "sub_frame_accelerations", "pinches", "skin_roots", "sub_frame_skin_roots"}
    elsewhere |= {"goal", "reactions", "normals", "normal_twist", "root_normals"}
    elsewhere |= {check.id for check in CHECKS if check.id.startswith(("over_", "deform_"))}
    proved = {param.values[0][0] for param in DEFECTS}  # type: ignore[index]
    assert proved | elsewhere == {check.id for check in CHECKS}


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "hairbake_validate", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT / "validation")},
    )


def test_program_passes_a_good_cache(good_cache: CacheBuilder, tmp_path: Path) -> None:
    done = run(good_cache.directory, "--json", tmp_path / "report.json")
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["passed"] and len(report["checks"]) == len(CHECKS)


def test_program_names_the_place_of_a_defect_and_a_remedy(good_cache: CacheBuilder, tmp_path: Path) -> None:
    frame_defects.stretched_segment(good_cache)
    done = run(good_cache.directory, "--json", tmp_path / "report.json")
    assert done.returncode == 1
    assert "FAILED" in done.stdout
    assert f"frame {MIDDLE}, {HAIR}, curve 4: " in done.stdout and "allowed 0.0001" in done.stdout
    assert "help: remove edits that stretch strands" in done.stdout
    checks = {check["id"]: check for check in json.loads((tmp_path / "report.json").read_text())["checks"]}
    found = checks["segments"]
    assert (found["status"], found["frame"], found["prim"], found["curve"]) == ("fail", MIDDLE, HAIR, 4)
    assert found["worst"] == pytest.approx(5e-4, rel=0.05)
    others = {name: check["status"] for name, check in checks.items() if name != "segments"}
    # Of over mode there is nothing in this cache, and no animation is given.
    skipped = {name for name, status in others.items() if status == "skip"}
    assert skipped == {name for name in others if name.startswith(("over_", "deform_", "goal"))}
    assert all(status == "pass" for name, status in others.items() if name not in skipped)


@pytest.mark.parametrize(
    "arguments", ["", "/nonexistent", "x --frames first", "x --frames 1-9x0", "x --only all", "x --jobs 0"]
)
def test_program_exits_2_on_wrong_usage(arguments: str) -> None:
    done = run(*arguments.split())
    assert done.returncode == 2
    assert done.stderr


def test_two_processes_find_what_one_finds(good_cache: CacheBuilder, monkeypatch: pytest.MonkeyPatch) -> None:
    motion_defects.one_frame_jump(good_cache)
    frame_defects.stretched_guide(good_cache)
    alone = validate(good_cache.directory).as_json()
    monkeypatch.setattr("hairbake_validate.run.CHUNK", (3, 3))
    assert validate(good_cache.directory, jobs=2).as_json() == alone


def test_only_the_chosen_frames_are_checked(good_cache: CacheBuilder) -> None:
    frame_defects.stretched_segment(good_cache)
    assert validate(good_cache.directory, frames=range(1005, 1007)).passed
    assert not validate(good_cache.directory, frames=range(1003, 1004)).passed


def test_quick_run_skips_checksums_and_reports_missing_files(good_cache: CacheBuilder) -> None:
    file_defects.static_layer_changed(good_cache)
    report = validate(good_cache.directory, quick=True)
    assert report.passed and report.outcomes["checksums"].status == "skip"
    good_cache.frame(1004).unlink()
    assert not validate(good_cache.directory, frames=range(1001, 1002), quick=True).passed


def test_every_check_says_what_to_do() -> None:
    for check in CHECKS:
        for text in (check.description, check.help):
            assert (text and text[0].islower()) or text.startswith("Pixar"), text
            assert not text.endswith("."), text
