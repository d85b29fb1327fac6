"""The Markdown files of the repository, as far as tests look into them."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from support import ROOT

NOT_OURS = {"target", "shared", "out"}
"""Folders of the repository's root that hold no sources."""

FENCE = re.compile(r"\s*(```+)\s*(\w*)")
CODE = re.compile(r"`[^`]*`")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)(?:\s+\"[^\"]*\")?\)")


@dataclass(frozen=True)
class Block:
    """A fenced block."""

    language: str
    lines: list[str]


@dataclass(frozen=True)
class Page:
    """A Markdown file."""

    path: Path

    @property
    def name(self) -> str:
        """Path from the repository's root."""
        return self.path.relative_to(ROOT).as_posix()

    @property
    def text(self) -> str:
        """All of it."""
        return self.path.read_text(encoding="utf-8")

    def _parts(self) -> Iterator[tuple[Block | None, str]]:
        """Lines of prose, and blocks in their place."""
        block, fence = None, ""
        for line in self.text.splitlines():
            mark = FENCE.match(line)
            if block is not None:
                if mark and mark[1] == fence and not mark[2]:
                    yield block, ""
                    block = None
                else:
                    block.lines.append(line)
            elif mark:
                block, fence = Block(mark[2], []), mark[1]
            else:
                yield None, line
        assert block is None, f"{self.name}: a fence is not closed"

    def blocks(self) -> list[Block]:
        """All fenced blocks."""
        return [block for block, _ in self._parts() if block]

    def prose(self) -> list[str]:
        """The lines outside of fenced blocks."""
        return [line for block, line in self._parts() if not block]

    def commands(self) -> list[str]:
        """The commands of its shell blocks, without comments; a line that ends in a backslash continues."""
        lines = [line for block in self.blocks() if block.language == "sh" for line in block.lines]
        joined = re.sub(r"\\\n\s*", "", "\n".join(lines)).splitlines()
        return [line for line in (re.sub(r"(^|\s)#.*", "", line).strip() for line in joined) if line]

    def links(self) -> list[str]:
        """The targets of links and pictures."""
        return LINK.findall(CODE.sub("`", "\n".join(self.prose())))

    def anchors(self) -> set[str]:
        """The anchors of its headings, as a forge makes them."""
        anchors: set[str] = set()
        for line in self.prose():
            heading = re.match(r"#{1,6}\s+(.*)", line)
            if heading:
                # The text of links counts, and so does that of code.
                text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading[1]).replace("`", "")
                slug = re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", "-")
                number = 0
                while (f"{slug}-{number}" if number else slug) in anchors:
                    number += 1
                anchors.add(f"{slug}-{number}" if number else slug)
        return anchors


def pages() -> list[Page]:
    """All Markdown files of the repository."""
    found = []
    for path in sorted(ROOT.rglob("*.md")):
        parts = path.relative_to(ROOT).parts
        if parts[0] not in NOT_OURS and not any(part.startswith(".") for part in parts[:-1]):
            found.append(Page(path))
    return found
