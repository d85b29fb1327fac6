"""The rez package, built and entered by rez.

Its build calls cargo, for which a stand-in copies the program under test.
"""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from program.wheel_source import OFFLINE, copy_sources, write_cargo
from support import ROOT, needs_hairbake

pytest.importorskip("rez")

from rez.packages import get_developer_package
from rez.resolved_context import ResolvedContext

RUST = 'name = "rust"\nversion = "1"\ndef commands():\n    env.PATH.append("{root}/bin")\n'


@needs_hairbake
# rez imports its plug-ins in a way that Python deprecates.
@pytest.mark.filterwarnings("ignore:the load_module:DeprecationWarning")
def test_package_builds_and_provides_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    packages, source = tmp_path / "packages", tmp_path / "source/pipeline/rez"
    write_cargo(packages / "rust/1/bin/cargo")
    for name, program in (("python3", sys.executable), ("rustc", shutil.which("rustc"))):
        wrapper = packages / "rust/1/bin" / name
        wrapper.write_text(f'#!/bin/sh\nexec {program} "$@"\n')
        wrapper.chmod(0o755)
    (packages / "rust/1/package.py").write_text(RUST)
    copy_sources(tmp_path / "source")
    for name, value in OFFLINE.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("HAIRBAKE", raising=False)
    monkeypatch.setenv("REZ_PACKAGES_PATH", str(packages))
    monkeypatch.setenv("REZ_LOCAL_PACKAGES_PATH", str(packages))
    build = [str(Path(sys.executable).with_name("rez-build")), "--install"]
    built = subprocess.run(build, cwd=source, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    context = ResolvedContext(["hairbake"], package_paths=[str(packages)])
    found = "import hairbake; print(hairbake.find_program())"
    command = f"hairbake --version && {sys.executable} -c '{found}'"
    shell = context.execute_shell(command=command, stdout=subprocess.PIPE, text=True)
    output, _ = shell.communicate()
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())["package"]["version"]
    assert output == f"hairbake {version}\n{packages}/hairbake/{version}/bin/hairbake\n"
    assert str(get_developer_package(str(source)).version) == version
