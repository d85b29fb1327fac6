"""Which curves of a stage become guides and which render strands, and when strands are grown."""

from pathlib import Path

import pytest
from pxr import UsdGeom

from support import Run
from usd_import.stages import INTS, Groom, Imports, add_curves, add_primvar, hanging, new_stage

SECTIONS = ("--sections", "4")


def stage_of(path: Path, **prims: tuple[int, str | None]) -> Path:
    """A stage with curves at `/groom/NAME`; the values are their number and their purpose."""
    stage = new_stage(path)
    for k, (name, (count, purpose)) in enumerate(prims.items()):
        curves = add_curves(stage, f"/groom/{name.replace('__', '/')}", hanging(count) + [0, 0, 0.01 * k])
        if purpose:
            curves.CreatePurposeAttr(purpose)
    stage.Save()
    return path


def sizes(groom: Groom) -> tuple[int, int]:
    """Numbers of guides and of render strands."""
    strands = len(groom.array("strands", "id")) if "strands" in groom.file else 0
    return len(groom.array("guides", "id")), strands


@pytest.mark.parametrize(
    ("prims", "guides", "strands", "said"),
    [
        # Every curve of the file is kept as it is.
        (
            {"scalp": (9, "render"), "sim": (3, "proxy")},
            3,
            9,
            "3 curves of /groom/sim (purpose proxy, beside",
        ),
        ({"scalp": (9, None), "sim": (3, "guide")}, 3, 9, "3 curves of /groom/sim (purpose guide)"),
        ({"scalp": (9, None), "hairGuides": (3, None)}, 3, 9, "3 curves of /groom/hairGuides (by name)"),
        ({"hair__a": (5, None), "hair__b": (4, None), "Guides__a": (3, None)}, 3, 9, "/groom/Guides/a"),
        (
            {"guided": (9, "render"), "other": (3, "guide")},
            3,
            9,
            "9 curves of /groom/guided (purpose render)",
        ),
        ({"scalp": (9, "render")}, 9, 9, "9 curves of /groom/scalp (purpose render)"),
        ({"scalp": (9, "proxy")}, 9, 9, "9 curves of /groom/scalp (purpose proxy)"),
        ({"strand": (1, None)}, 1, 1, "1 curves of /groom/strand (purpose default)"),
    ],
)
def test_own_strands_are_kept_and_none_grown(
    imports: Imports,
    tmp_path: Path,
    prims: dict[str, tuple[int, str | None]],
    guides: int,
    strands: int,
    said: str,
) -> None:
    groom, messages = imports(stage_of(tmp_path / "a.usda", **prims), *SECTIONS)
    assert sizes(groom) == (guides, strands)
    assert said in messages and f"{strands} render strands: all those of the file, and none grown" in messages


def test_a_primvar_beats_purpose_and_name(imports: Imports, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/groom/guides", hanging(5))
    hair.CreatePurposeAttr("render")
    add_primvar(hair, "groom_guide", INTS, "uniform", [1, 0, 0, 0, 1])
    UsdGeom.Imageable(add_curves(stage, "/groom/more", hanging(2) + [0, 0, 0.1])).CreatePurposeAttr("guide")
    stage.Save()
    groom, messages = imports(tmp_path / "a.usda", *SECTIONS)
    assert sizes(groom) == (4, 3)
    assert "/groom/guides: 2 of 5 curves are guides (primvar)" in messages


def test_strands_are_grown_around_guides_alone_or_if_asked(imports: Imports, tmp_path: Path) -> None:
    only = stage_of(tmp_path / "guides.usda", sim=(3, "guide"))
    groom, messages = imports(only, *SECTIONS)
    assert sizes(groom) == (3, 150)
    assert (
        "150 render strands, grown: 50 around each guide" in messages and "--strands-per-guide N" in messages
    )
    assert sizes(imports(only, *SECTIONS, "--strands-per-guide", "2")[0]) == (3, 6)
    assert sizes(imports(only, *SECTIONS, "--strands-per-guide", "0")[0]) == (3, 0)
    both = stage_of(tmp_path / "both.usda", sim=(3, "guide"), scalp=(9, "render"))
    groom, messages = imports(both, *SECTIONS, "--strands-per-guide", "2")
    assert sizes(groom) == (3, 6)
    assert "9 strands of the file are not drawn: others are grown in their place, as asked" in messages
    assert sizes(imports(both, *SECTIONS, "--strands-per-guide", "0")[0]) == (3, 9)


def test_strands_of_another_file_and_grown_ones_exclude_each_other(hairbake: Run, tmp_path: Path) -> None:
    only = stage_of(tmp_path / "guides.usda", sim=(3, "guide"))
    done = hairbake(
        "import", "groom", only, "--strands", only, "--strands-per-guide", "2", "-o", tmp_path / "g.json"
    )
    assert done.returncode == 64 and "use one of the two" in done.stderr
    assert not (tmp_path / "g.json").exists()
