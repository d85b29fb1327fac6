r"""Sphinx extension for a site made of a repository's Markdown files.

It adds the table of contents to the root page, renders LaTeX as MathML, so that pages need no script and no
network, numbers equations by their `\tag`, and links citations such as (4.2) to their equation.
"""

import re
from html import escape
from pathlib import Path
from typing import Any

import math_core
from docutils import nodes
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.writers.html5 import HTML5Translator

CONTENTS = Path(__file__).with_name("contents.md")
TAG = re.compile(r"\\tag\{([^}]*)\}")
CITED = re.compile(r"\((\d+\.\d+)\)")

_latex = math_core.LatexToMathML()


def mathml(latex: str, *, display: bool) -> str:
    """Returns a formula as MathML; an error names the formula."""
    try:
        return _latex.convert_with_local_state(latex, displaystyle=display)
    except math_core.LatexError as error:
        message = f"not LaTeX that can be rendered: {latex}\n{error}"
        raise ExtensionError(message) from None


def visit_math(translator: HTML5Translator, node: nodes.math) -> None:
    """Writes an inline formula, which stands between backticks in the source."""
    translator.body.append(mathml(node.astext().strip("`"), display=False))
    raise nodes.SkipNode


def visit_math_block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """Writes a displayed formula with its number, if it has one."""
    latex = node.astext()
    tag = TAG.search(latex)
    formula = mathml(TAG.sub("", latex).strip(), display=True)
    number, place = "", ""
    if tag:
        name = escape(tag[1])
        place = f' id="eq-{name}"'
        number = f'<span class="number">({name})</span>'
    translator.body.append(f'<div class="equation"{place}>{formula}{number}</div>\n')
    raise nodes.SkipNode


def add_contents(app: Sphinx, docname: str, source: list[str]) -> None:
    """Appends the table of contents to the root page, which a forge shows without it.

    It leaves out pages that are not there yet. Sphinx itself reports pages that the contents lack.
    """
    if docname != app.config.root_doc:
        return
    lines = CONTENTS.read_text(encoding="utf-8").splitlines()
    there = app.env.found_docs | {""}
    kept = [line for line in lines if line[:1] in ":`" or line in there]
    source[0] += "\n" + "\n".join(kept) + "\n"


def link_equations(_app: Sphinx, doctree: nodes.document, _docname: str) -> None:
    """Turns (4.2) in running text into a link, where the page has that equation."""
    tags = {tag for block in doctree.findall(nodes.math_block) for tag in TAG.findall(block.astext())}
    for text in list(doctree.findall(nodes.Text)):
        if isinstance(text.parent, nodes.paragraph | nodes.list_item):
            parts: list[nodes.Node] = []
            end = 0
            for cited in CITED.finditer(text):
                if cited[1] in tags:
                    parts.append(nodes.Text(text[end : cited.start()]))
                    parts.append(nodes.reference("", cited[0], internal=True, refuri=f"#eq-{cited[1]}"))
                    end = cited.end()
            if parts:
                text.parent.replace(text, [*parts, nodes.Text(text[end:])])


def write_index(app: Sphinx, error: Exception | None) -> None:
    """Writes the index.html that servers look for: it leads to the root page."""
    if error is None and app.builder.name == "html":
        page = f"{app.config.root_doc}.html"
        text = f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={page}">\n'
        (Path(app.outdir) / "index.html").write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Registers the extension with Sphinx."""
    # Drawings that a forge renders are shown as text.
    app.add_lexer("mermaid", TextLexer)
    app.add_node(nodes.math, override=True, html=(visit_math, None))
    app.add_node(nodes.math_block, override=True, html=(visit_math_block, None))
    app.connect("source-read", add_contents)
    app.connect("doctree-resolved", link_equations)
    app.connect("build-finished", write_index)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
