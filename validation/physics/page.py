"""The report page: a table of errors and the plots, in one self-contained HTML file."""

import base64
import html
import io
from pathlib import Path

from .study import Plot, Row, Study

STYLE = """body{font:15px/1.5 sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;margin:1rem 0}
td,th{padding:.15rem .8rem;text-align:left;border-bottom:1px solid #ddd}
td.n{text-align:right;font-variant-numeric:tabular-nums}.miss{background:#fbd5d0}.met{color:#1a6b2c}
figure{display:inline-block;margin:.5rem 1rem .5rem 0;max-width:33rem}img{width:100%}
figcaption{font-size:13px;color:#555}"""


def write(path: Path, studies: list[Study], version: str) -> None:
    """Writes the page of `studies` of hairbake `version`."""
    rows = [row for study in studies for row in study.rows if row.goal is not None]
    met = sum(row.passed for row in rows)
    body = [
        "<h1>hairbake: the rod against theory</h1>",
        f"<p>{html.escape(version)}. {met} of {len(rows)} goals met. "
        "Reference solutions come from independent solvers. hairbake is run as a program on scene files, "
        "and its USD caches are read back.</p>",
    ]
    for study in studies:
        body += [f"<h2>{html.escape(study.title)}</h2>", study.text, table(study.rows)]
        body += [figure(plot) for plot in study.plots]
    head = "<!doctype html><html lang=en><meta charset=utf-8><title>hairbake: physics</title>"
    page = f"{head}<style>{STYLE}</style>" + "\n".join(body) + "</html>\n"
    path.write_text(page, encoding="utf-8")


def table(rows: list[Row]) -> str:
    """The rows as an HTML table."""
    head = "<tr><th>quantity<th>theory<th>hairbake<th>error<th>goal<th></tr>"
    lines = []
    for row in rows:
        verdict = "" if row.goal is None else "met" if row.passed else "missed"
        goal = "" if row.goal is None else f"{row.goal:.3g}"
        style = ' class="miss"' if not row.passed else ""
        values = (number(row.expected), number(row.measured), f"{row.error:.2e}", goal)
        cells = "".join(f'<td class="n">{html.escape(value)}' for value in values)
        lines.append(f'<tr{style}><td>{html.escape(row.what)}{cells}<td class="met">{verdict}</tr>')
    return f"<table>{head}{''.join(lines)}</table>"


def number(value: float | str) -> str:
    """A value as the table shows it."""
    return value if isinstance(value, str) else f"{value:.6g}"


def figure(plot: Plot) -> str:
    """The plot as an inline PNG."""
    # Only the page needs matplotlib.
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415
    from matplotlib.ticker import NullFormatter  # noqa: PLC0415

    drawing = Figure(figsize=(6, 4.2), layout="constrained")
    FigureCanvasAgg(drawing)
    axes = drawing.add_subplot()
    plot.draw(axes)
    for axis in (axes.xaxis, axes.yaxis):
        # The labels of minor ticks on a logarithmic axis of about a decade overlap.
        axis.set_minor_formatter(NullFormatter())
    picture = io.BytesIO()
    drawing.savefig(picture, format="png", dpi=130)
    data = base64.b64encode(picture.getvalue()).decode()
    caption = html.escape(plot.caption)
    image = f'<img alt="{caption}" src="data:image/png;base64,{data}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"
