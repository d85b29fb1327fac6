"""docs/tutorial.md, run as it stands there."""

import os
import subprocess
import sys

from pages.markdown import Page
from support import HAIRBAKE, ROOT

LINES = Page(ROOT / "docs/tutorial.md").commands()


def test_every_line_of_the_tutorial(hairbake, tmp_path):
    """All but Blender's, which has a test of its own."""
    (tmp_path / "pipeline").symlink_to(ROOT / "pipeline")
    (tmp_path / ".venv").symlink_to(sys.prefix)
    path = f"{HAIRBAKE.parent}:{os.environ['PATH']}"
    lines = [line for line in LINES if not line.startswith(".blender")]
    assert len(lines) == len(LINES) - 2 >= 8
    for line in lines:
        done = subprocess.run(
            line, shell=True, cwd=tmp_path, env={**os.environ, "PATH": path}, capture_output=True, text=True
        )
        assert done.returncode == 0, f"{line}\n{done.stderr}\n{done.stdout}"
    assert (tmp_path / "shot/sheet.png").stat().st_size > 10_000
    assert len(list((tmp_path / "shot/cache").glob("hair.1*.usdc"))) == 24 + 2
