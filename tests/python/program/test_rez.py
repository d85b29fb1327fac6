"""The rez package, built and entered by rez.

It calls cargo, for which a stand-in copies the program under test.
"""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from support import HAIRBAKE, ROOT, needs_hairbake

pytest.importorskip("rez")

from rez.packages import get_developer_package
from rez.resolved_context import ResolvedContext

RUST = 'name = "rust"\nversion = "1"\ndef commands():\n    env.PATH.append("{root}/bin")\n'
CARGO = """#!/bin/sh
[ "$1 $2" = "install --locked" ] && mkdir -p "$6/bin" && cp "$HAIRBAKE" "$6/bin/hairbake"
"""


@needs_hairbake
# rez imports its plug-ins in a way that Python deprecates.
@pytest.mark.filterwarnings("ignore:the load_module:DeprecationWarning")
def test_package_builds_and_provides_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
    build = [str(Path(sys.executable).with_name("rez-build")), "--install"]
    built = subprocess.run(build, cwd=source, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    context = ResolvedContext(["hairbake"], package_paths=[str(packages)])
    shell = context.execute_shell(command="hairbake --version", stdout=subprocess.PIPE, text=True)
    output, _ = shell.communicate()
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())["package"]["version"]
    assert output == f"hairbake {version}\n"
    assert str(get_developer_package(str(source)).version) == version
