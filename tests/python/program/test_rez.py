"""The rez package, built and entered by rez itself; cargo, which it calls, is a stand-in that copies the program that the tests have built."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

pytest.importorskip("rez")

from rez.packages import get_developer_package
from rez.resolved_context import ResolvedContext

from support import HAIRBAKE, ROOT, needs_hairbake

RUST = 'name = "rust"\nversion = "1"\ndef commands():\n    env.PATH.append("{root}/bin")\n'
CARGO = (
    '#!/bin/sh\n[ "$1 $2" = "install --locked" ] && mkdir -p "$6/bin" && cp "$HAIRBAKE" "$6/bin/hairbake"\n'
)


@needs_hairbake
def test_the_package_builds_and_brings_the_program(tmp_path, monkeypatch):
    packages, source = tmp_path / "packages", tmp_path / "source/pipeline/rez"
    cargo = packages / "rust/1/bin/cargo"
    cargo.parent.mkdir(parents=True)
    cargo.write_text(CARGO)
    cargo.chmod(0o755)
    (packages / "rust/1/package.py").write_text(RUST)
    source.mkdir(parents=True)
    shutil.copy(ROOT / "pipeline/rez/package.py", source)
    monkeypatch.setenv("HAIRBAKE", str(HAIRBAKE))
    monkeypatch.setenv("REZ_PACKAGES_PATH", str(packages))
    monkeypatch.setenv("REZ_LOCAL_PACKAGES_PATH", str(packages))
    built = subprocess.run(
        [Path(sys.executable).with_name("rez-build"), "--install"], cwd=source, capture_output=True, text=True
    )
    assert built.returncode == 0, built.stdout + built.stderr
    context = ResolvedContext(["hairbake"], package_paths=[str(packages)])
    said, _ = context.execute_shell(
        command="hairbake --version", stdout=subprocess.PIPE, text=True
    ).communicate()
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())["package"]["version"]
    assert said == f"hairbake {version}\n"
    assert str(get_developer_package(str(source)).version) == version
