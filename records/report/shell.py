"""What every page of the project has: one HTML file with styles, plots and their library inside."""

import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from pathlib import Path

from plotly.offline import get_plotlyjs

from records.figures_file import write_text
from records.report.figures import Figure

# Nothing may be loaded from anywhere: the page is complete, and a reader's browser holds it to that.
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"


def document(title: str, body: Iterable[str], drawn: Sequence[Figure]) -> str:
    """The page as HTML: `body` in order, the figures that it has places for drawn by a script."""
    return (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>"
        f"<meta http-equiv='Content-Security-Policy' content=\"{POLICY}\">"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        f"<title>Slewright: {escape(title)}</title><style>{_asset('style.css')}</style></head>\n"
        f"<body><main>{''.join(body)}</main>\n"
        f"<script>{get_plotlyjs()}</script>\n"
        f"<script type='application/json' id='figures'>{_json(drawn)}</script>\n"
        f"<script>{_asset('draw.js')}</script></body></html>\n"
    )


def place(figure: Figure) -> str:
    """Where a figure is drawn, with its heading and what it shows."""
    wide = " class='wide'" if figure.wide else ""
    return (
        f"<figure{wide}><h3>{escape(figure.title)}</h3><figcaption>{escape(figure.caption)}</figcaption>"
        f"<div class='plot' id='{escape(figure.name)}' style='height:{figure.height}px'></div></figure>"
    )


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """The list of facts under a page's heading."""
    items = "".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in pairs)
    return f"<dl class='facts'>{items}</dl>"


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], first: str = "") -> str:
    """A table of text; the first column is a heading of its row, the others are right-aligned."""
    head = "".join(f"<th>{escape(c)}</th>" for c in columns)
    lines = "".join(
        f"<tr><th scope='row'>{escape(row[0])}</th>{''.join(f'<td>{escape(c)}</td>' for c in row[1:])}</tr>"
        for row in rows
    )
    return f"<div class='scroll'><table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table></div>"


def write_whole(path: Path | str, text: str) -> Path:
    """Write `text` so that a reader sees the old file or the new; makes the folder."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)
    return path


def _asset(name: str) -> str:
    return resources.files("records.report").joinpath(name).read_text("utf-8")


def _json(drawn: Sequence[Figure]) -> str:
    plain = [
        {"name": f.name, "data": f.data, "layout": f.layout, "height": f.height, "frames": f.frames}
        for f in drawn
    ]
    # "</script>" in a name must not end the block
    return json.dumps(plain, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
