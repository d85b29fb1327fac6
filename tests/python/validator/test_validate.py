"""Every defect that the validator claims to catch, injected into a good cache: exactly its own check must fail."""

import json
import os
import subprocess
import sys

import pytest

from hairbake_validate.run import CHECKS, validate
from support import ROOT
from validator.defects import (
    DEFECTS,
    HAIR,
    MIDDLE,
    broken,
    one_frame_pop,
    static_layer_changed,
    stretched_guide,
    stretched_segment,
)


def test_good_cache_passes(good_cache):
    report = validate(good_cache.directory)
    assert broken(report) == set(), report.as_text()


@pytest.mark.parametrize("checks, inject", DEFECTS)
def test_fault_fails_its_own_check(good_cache, checks, inject):
    inject(good_cache)
    report = validate(good_cache.directory)
    assert broken(report) == set(checks), report.as_text()
    assert report.passed == (report.outcomes[checks[0]].status == "warn")


def test_every_check_has_a_fault():
    elsewhere = {"accelerations", "sub_frame_accelerations"}
    assert {param.values[0][0] for param in DEFECTS} | elsewhere == {check.id for check in CHECKS}


def run(*arguments) -> subprocess.CompletedProcess:
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "validation")}
    return subprocess.run(
        [sys.executable, "-m", "hairbake_validate", *map(str, arguments)],
        capture_output=True,
        text=True,
        env=environment,
    )


def test_program_passes_a_good_cache(good_cache, tmp_path):
    done = run(good_cache.directory, "--json", tmp_path / "report.json")
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["passed"] and len(report["checks"]) == len(CHECKS)


def test_program_names_the_place_of_a_fault(good_cache, tmp_path):
    stretched_segment(good_cache)
    done = run(good_cache.directory, "--json", tmp_path / "report.json")
    assert done.returncode == 1
    assert "FAILED" in done.stdout
    checks = {check["id"]: check for check in json.loads((tmp_path / "report.json").read_text())["checks"]}
    found = checks["segments"]
    assert (found["status"], found["frame"], found["prim"], found["curve"]) == ("fail", MIDDLE, HAIR, 4)
    assert found["worst"] == pytest.approx(5e-4, rel=0.05)
    assert all(check["status"] == "pass" for name, check in checks.items() if name != "segments")


@pytest.mark.parametrize(
    "arguments", ["", "/nonexistent", "x --frames first", "x --frames 1-9x0", "x --only all", "x --jobs 0"]
)
def test_program_exits_2_on_wrong_usage(arguments):
    done = run(*arguments.split())
    assert done.returncode == 2
    assert done.stderr


def test_processes_find_what_one_finds(good_cache, monkeypatch):
    one_frame_pop(good_cache)
    stretched_guide(good_cache)
    alone = validate(good_cache.directory).as_json()
    monkeypatch.setattr("hairbake_validate.run.CHUNK", 3)
    assert validate(good_cache.directory, jobs=2).as_json() == alone


def test_frames_outside_the_choice_are_not_looked_at(good_cache):
    stretched_segment(good_cache)
    assert validate(good_cache.directory, frames=range(1005, 1007)).passed
    assert not validate(good_cache.directory, frames=range(1003, 1004)).passed


def test_quick_run_skips_checksums_and_misses_no_file(good_cache):
    static_layer_changed(good_cache)
    report = validate(good_cache.directory, quick=True)
    assert report.passed and report.outcomes["checksums"].status == "skip"
    good_cache.frame(1004).unlink()
    assert not validate(good_cache.directory, frames=range(1001, 1002), quick=True).passed
