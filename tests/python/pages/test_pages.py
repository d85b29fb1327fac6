"""Links, commands, formulas and tables of the repository's Markdown files."""

import importlib.util
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from pages.markdown import Page, pages
from support import ROOT

PAGES = pages()
each_page = pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])

THEORY = Page(ROOT / "docs/theory.md")
CODE_SPAN = re.compile(r"`[^`]*`")
TAG = re.compile(r"\\tag\{([^}]*)\}")


def is_external(link: str) -> bool:
    return bool(re.match(r"[a-z][a-z0-9+.-]*:", link))


def test_the_pages_are_found() -> None:
    names = {page.name for page in PAGES}
    assert {"README.md", "docs/theory.md", "docs/tutorial.md", "validation/README.md"} <= names
    assert sum(len(page.links()) for page in PAGES) > 100


@each_page
def test_no_page_has_the_marks_of_a_merge(page: Page) -> None:
    marks = re.findall(
        r"^(?:<{7} .*|={7}|>{7} .*)$", (ROOT / page.name).read_text(encoding="utf-8"), re.MULTILINE
    )
    assert not marks, marks


@each_page
def test_relative_links_and_anchors_resolve(page: Page) -> None:
    broken = []
    for link in page.links():
        if is_external(link):
            continue
        target, _, anchor = link.partition("#")
        path = page.path.parent / target if target else page.path
        found = path.exists() and path.resolve().is_relative_to(ROOT)
        if not found or (anchor and (path.suffix != ".md" or anchor not in Page(path).anchors())):
            broken.append(link)
    assert not broken


@each_page
def test_external_links_are_addresses(page: Page) -> None:
    for link in filter(is_external, page.links()):
        address = urlsplit(link)
        assert address.scheme == "https", link
        assert re.fullmatch(r"([a-z0-9-]+\.)+[a-z]{2,}", address.netloc), link


def test_anchors_are_those_of_a_forge(tmp_path: Path) -> None:
    path = tmp_path / "page.md"
    path.write_text("# A `b_c`, d!\n## A b_c d\n### 4.5 Newton's method\n```sh\n# no heading\n```\n")
    assert Page(path).anchors() == {"a-b_c-d", "a-b_c-d-1", "45-newtons-method"}


def test_commands_of_the_quick_start_name_files_that_exist() -> None:
    readme = Page(ROOT / "README.md")
    quick = [command for block in readme.blocks()[:3] for command in block.lines]
    assert "tests/run" in quick
    assert quick[0] == (
        "cargo run --release -- sample short -o out/short && "
        "cargo run --release -- out/short/groom.json out/short/shake.json -o out/cache"
    )
    crate = re.search(r'^name = "(.*)"', (ROOT / "Cargo.toml").read_text(), re.M)
    assert crate
    made: set[str] = {f"target/release/{crate[1]}"}
    for command in quick:
        words = shlex.split(command)
        for i, word in enumerate(words):
            if words[i - 1] == "-o":
                made.add(word)
            elif "/" in word:
                known = any(word == path or word.startswith(f"{path}/") for path in made)
                assert known or (ROOT / word).exists(), word


@each_page
def test_commands_use_options_of_the_program_as_it_is(
    page: Page, hairbake: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    helps: dict[str, str] = {}
    for command in page.commands():
        words = re.split(r"\s+", command)
        if words[0].rpartition("/")[2] != "hairbake" and "cargo run" not in command:
            continue
        for options in re.findall(r"(?:hairbake|release --) (.*?)(?: && |\||>|$)", command):
            called = shlex.split(options)
            name = " ".join(called[: 2 if called[0] == "import" else 1])
            name = name if re.fullmatch(r"[a-z ]+", name) else "bake"
            if name not in helps:
                done = [hairbake(*name.split(), "--help"), hairbake("--help")]
                assert all(run.returncode == 0 for run in done), command
                helps[name] = "".join(run.stdout for run in done)
            for option in re.findall(r"(?<=\s)(--[a-z-]+|-[a-z])\b", f" {options}"):
                assert re.search(rf"(?<![\w-]){option}\b", helps[name]), f"{option} in {command}"


def test_the_table_of_settings_is_that_of_the_schema() -> None:
    schema = json.loads((ROOT / "pipeline/schemas/anim.schema.json").read_text())
    settings = schema["$defs"]["SettingsFile"]["properties"]
    text = Page(ROOT / "docs/reference.md").text.partition("\n## Settings\n")[2].partition("\n## ")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines()]
    table = {row[1].strip("`"): row[2].strip("`") for row in rows if len(row) == 5 and row[1].startswith("`")}
    assert set(table) == set(settings)
    for key, setting in settings.items():
        default = setting["default"]
        told = json.loads(table[key]) if not isinstance(default, str) else table[key]
        assert told == default, key


def test_the_table_of_materials_is_that_of_the_schema() -> None:
    schema = json.loads((ROOT / "pipeline/schemas/groom.schema.json").read_text())
    material = set(schema["$defs"]["MaterialFile"]["properties"]) - {"name"}
    text = Page(ROOT / "docs/reference.md").text.partition("\n## Materials\n")[2].partition("\n## ")[0]
    keys = {
        key
        for line in text.splitlines()
        for key in re.findall(r"`(\w+)`", line.split(" | ")[0])
        if "|" in line
    }
    assert keys == material


@each_page
def test_formulas_stand_as_forges_and_the_site_read_them(page: Page) -> None:
    """Inline between $` and `$, displayed in blocks: a forge may take anything else for emphasis."""
    for line in page.prose():
        without = re.sub(r"\$`[^`$]+`\$", "", line)
        assert "$" not in CODE_SPAN.sub("", without), f"{page.name}: {line}"
    for block in page.blocks():
        if block.language == "math":
            tags = [line for line in block.lines if TAG.search(line)]
            assert len(tags) <= 1 and all(TAG.fullmatch(line) for line in tags), block.lines


@each_page
def test_equations_that_pages_cite_exist(page: Page) -> None:
    known = set(TAG.findall(THEORY.text))
    if not page.name.startswith(("docs/", "validation/")):
        return
    boxes = [line for block in page.blocks() if block.language == "text" for line in block.lines]
    for line in page.prose() + (boxes if page.name == THEORY.name else []):
        for cited in re.findall(r"\(([1-9]\.\d+(?:(?:, | and | to )[1-9]\.\d+)*)\)", CODE_SPAN.sub("", line)):
            for number in re.findall(r"\d\.\d+", cited):
                assert number in known, f"{page.name}: ({number}) in {line}"


@each_page
def test_modules_that_pages_name_exist(page: Page) -> None:
    names = re.findall(r"`((?:[a-z_]+::)+\w+)`", "\n".join(page.prose()))
    if page.name == "docs/architecture.md":
        drawing = [line for block in page.blocks() if block.language == "text" for line in block.lines]
        names += re.findall(r"((?:[a-z_]+::)+\w+)", "\n".join(drawing))
    for name in names:
        *modules, last = name.split("::")
        folder = ROOT / "src" / "/".join(modules)
        if any((folder / below).exists() for below in (last, f"{last}.rs")):
            continue
        files = [folder.with_suffix(".rs"), *folder.glob("*.rs")]
        item = re.compile(rf"\b(?:struct|enum|trait|fn|type|const) {last}\b")
        assert any(path.is_file() and item.search(path.read_text()) for path in files), f"{page.name}: {name}"


def test_the_references_of_the_theory_are_cited_and_known() -> None:
    body, _, references = THEORY.text.partition("\n## References\n")
    listed = []
    for entry in re.findall(r"^- (.*(?:\n  .*)*)", references, re.M):
        text = " ".join(entry.split())
        names = re.match(r"(.*?)\. (?=[A-ZÀ-Þ*])", re.sub(r"\b(?:[A-Z]\.[ -]?)+", "", text))
        date = re.search(r"(\d{4})\.$", text)
        assert names and date, text
        listed.append((names[1].split(",")[0].strip(), date[1]))
    assert len(listed) > 20
    for name, year in listed:
        assert re.search(rf"{name}[^\[\]]*?\[?{year}", body), f"{name} {year} is not cited"
    for name, year in re.findall(r"\[[^\]]*?([A-Z][\w-]+)[^\[\]()]*? (\d{4})[^\]]*\](?!\()", body):
        assert year in {y for _, y in listed}, f"{name} {year} is not listed"


@pytest.mark.slow
@pytest.mark.skipif(not importlib.util.find_spec("sphinx"), reason="Sphinx is missing")
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--keep-going", "--quiet"]
    command += ["-d", str(tmp_path / "cache"), "-c", "docs/site", ".", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site/index.html").is_file()
    page = (tmp_path / "site/docs/theory.html").read_text(encoding="utf-8")
    assert page.count('id="eq-') == len(TAG.findall(THEORY.text))
    assert "\\frac" not in page and '<script src="http' not in page
