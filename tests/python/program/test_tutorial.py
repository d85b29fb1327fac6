"""The commands of docs/tutorial.md, run as they are written."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pages.markdown import Page
from support import HAIRBAKE, ROOT, needs_hairbake

COMMANDS = Page(ROOT / "docs/tutorial.md").commands()


@needs_hairbake
@pytest.mark.slow
def test_every_command_of_the_tutorial(tmp_path: Path) -> None:
    (tmp_path / "pipeline").symlink_to(ROOT / "pipeline")
    (tmp_path / ".venv").symlink_to(sys.prefix)
    environment = {**os.environ, "PATH": f"{HAIRBAKE.parent}:{os.environ['PATH']}"}
    # Commands that need Blender are tested in test_blender.py.
    commands = [command for command in COMMANDS if not command.startswith(".blender")]
    assert len(commands) == len(COMMANDS) - 1 >= 8
    for command in commands:
        done = subprocess.run(
            command,
            shell=True,
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stderr}\n{done.stdout}"
    assert (tmp_path / "shot/front.png").stat().st_size > 10_000
    assert len(list((tmp_path / "shot/cache").glob("hair.1*.usdc"))) == 24 + 2
