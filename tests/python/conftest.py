"""Fixtures shared by all tests."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from support import HAIRBAKE, Run, run_hairbake, unwrapped
from usd_import.stages import Groom
from validator.good_cache import CacheBuilder

# `hairbake import` and `hairbake validate` run this Python.
os.environ.setdefault("HAIRBAKE_PYTHON", sys.executable)


@pytest.fixture(scope="session")
def good_cache_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of a cache that passes every check, not to be changed."""
    return CacheBuilder(tmp_path_factory.mktemp("good") / "cache").directory


@pytest.fixture
def good_cache(tmp_path: Path, good_cache_files: Path) -> CacheBuilder:
    """A fresh copy of a cache that passes every check."""
    return CacheBuilder(tmp_path / "cache", copy_of=good_cache_files)


@pytest.fixture
def hairbake() -> Run:
    """Runs the program; see `run_hairbake`."""
    if not HAIRBAKE.is_file():
        pytest.skip(f"{HAIRBAKE} is missing: run `cargo build`")
    return run_hairbake


@pytest.fixture
def imports(hairbake: Run, tmp_path: Path) -> Callable[..., tuple[Groom, str]]:
    """Imports a groom and returns it with the messages."""

    def imported(source: Path, *options: object) -> tuple[Groom, str]:
        out = tmp_path / "shot" / "groom.json"
        done = hairbake("import", "groom", source, *options, "-o", out)
        assert done.returncode == 0, done.stderr
        return Groom(out), done.stderr

    return imported


@pytest.fixture
def refused(hairbake: Run, tmp_path: Path) -> Callable[..., str]:
    """Runs a command that must be refused as bad input with nothing written, and returns its message."""

    def message(*arguments: object) -> str:
        out = tmp_path / "refused" / "out.json"
        done = hairbake(*arguments, "-o", out)
        assert (done.returncode, done.stdout) == (65, ""), done.stderr
        assert not out.parent.exists()
        assert "nothing written" in done.stderr
        return unwrapped(done.stderr)

    return message
