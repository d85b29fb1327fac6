"""The built program (`HAIRBAKE`, which `tests/run` sets), run on stages that the tests author, and what it writes read back."""

import os
import subprocess
from pathlib import Path

import pytest
from stages import Groom

HAIRBAKE = os.environ.get("HAIRBAKE", "")


def run(*arguments) -> subprocess.CompletedProcess:
    return subprocess.run([HAIRBAKE, *map(str, arguments)], capture_output=True, text=True)


@pytest.fixture
def hairbake():
    """Runs the program; its output is returned whatever comes of it."""
    if not os.path.exists(HAIRBAKE):
        pytest.skip("HAIRBAKE names no binary")
    return run


@pytest.fixture
def imports(hairbake, tmp_path):
    """Imports a groom and returns what it is and what was said."""

    def imported(source: Path, *options) -> tuple[Groom, str]:
        out = tmp_path / "shot" / "groom.json"
        done = hairbake("import", "groom", source, *options, "-o", out)
        assert done.returncode == 0, done.stderr
        return Groom(out), done.stderr

    return imported


@pytest.fixture
def refused(hairbake, tmp_path):
    """Runs what must be refused as bad input, with nothing written, and returns its words."""

    def words(*arguments) -> str:
        out = tmp_path / "refused" / "out.json"
        done = hairbake(*arguments, "-o", out)
        assert (done.returncode, done.stdout) == (65, ""), done.stderr
        assert not out.parent.exists()
        assert "nothing written" in done.stderr
        return " ".join(done.stderr.replace("│", " ").replace("╰─▶", " ").split())

    return words
