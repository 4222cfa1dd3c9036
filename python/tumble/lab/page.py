"""Pages to read: one HTML file with everything inside, a picture of its figures, and their numbers as CSV."""

import base64
import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure, FigureBase
from PIL import Image

from tumble._engine import ExportError, version
from tumble.style import FAINT, GRID, INK, PALETTE, PAPER, RC

DOTS = 120.0
"""Per inch, of the sheet of all figures."""

Draw = Callable[[FigureBase], None]

_CSS = f"""
body {{ margin: 0; background: {PAPER}; color: {INK};
  font: 16px/1.55 system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif; }}
main {{ max-width: 1180px; margin: 0 auto; padding: 2.2rem 1.5rem 4rem; }}
h1 {{ font-size: 1.9rem; line-height: 1.2; margin: 0 0 .3rem; }}
h2 {{ font-size: 1.3rem; margin: 2.6rem 0 .4rem; }}
p, ul {{ max-width: 78ch; margin: .5rem 0; }}
.lead {{ color: #57606a; margin-bottom: 1.2rem; }}
.points {{ list-style: none; padding: .9rem 1.2rem; margin: 1.2rem 0; max-width: none;
  background: #f4f6f8; border-left: 4px solid {PALETTE[0]}; }}
.points li {{ margin: .35rem 0; }}
img {{ display: block; width: 100%; height: auto; margin: .8rem 0; }}
.scroll {{ overflow-x: auto; }}
table {{ border-collapse: collapse; width: 100%; margin: .8rem 0;
  font-size: .8rem; font-variant-numeric: tabular-nums; }}
th, td {{ padding: .34rem .45rem; border-bottom: 1px solid {GRID}; text-align: right; white-space: nowrap; }}
th {{ font-weight: 600; vertical-align: bottom; border-bottom: 2px solid {FAINT}; line-height: 1.25; }}
th:first-child, td:first-child, td.text, th.text {{ text-align: left; }}
td.text, th.text {{ white-space: normal; }}
td.text:last-child {{ min-width: 12rem; }}
tr.group td {{ border-top: 2px solid {GRID}; }}
td b {{ font-weight: 600; }}
.none {{ color: {FAINT}; }}
.notes, footer {{ color: #57606a; font-size: .88rem; }}
@media print {{
  main {{ max-width: none; padding: 0; }}
  h2 {{ break-after: avoid; }}
  img, tr {{ break-inside: avoid; }}
}}
"""


@dataclass(frozen=True)
class Section:
    """A heading, what to see there, and a figure or a table."""

    title: str
    text: str
    """HTML."""
    figure: Draw | None = None
    height: float = 4.0
    """Of the figure [inch]."""
    alt: str = ""
    table: str = ""
    raster: bool = False
    """Whether it has too many strokes to be kept as lines."""


def write(
    folder: Path,
    name: str,
    title: str,
    lead: str,
    points: Sequence[str],
    sections: Sequence[Section],
    notes: Sequence[str],
    rows: Iterable[Mapping[str, Any]],
    width: float = 13.0,
) -> Path:
    """Writes NAME.html, NAME.png and NAME.csv and returns the first. Raises ExportError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _csv(folder / f"{name}.csv", list(rows))
        look: Any = RC
        with matplotlib.rc_context(look):
            drawn = [_Drawn(s, width) if s.figure else None for s in sections]
            _poster(folder / f"{name}.png", title, [d for d in drawn if d], width)
        pictures = [d.tag if d else "" for d in drawn]
        path = folder / f"{name}.html"
        path.write_text(document(title, lead, points, sections, pictures, notes), encoding="utf-8")
    except OSError as error:
        raise ExportError(f"{folder}: {error.strerror or error}") from error
    return path


def table(
    head: Sequence[str], rows: Sequence[Sequence[str]], text_columns: Sequence[int], groups: Sequence[int] = ()
) -> str:
    """A table of HTML cells; `groups` are rows that start a new group."""

    def cells(row: Sequence[str], tag: str) -> str:
        kinds = [' class="text"' if i in text_columns else "" for i in range(len(row))]
        return "".join(f"<{tag}{kind}>{cell}</{tag}>" for kind, cell in zip(kinds, row, strict=True))

    body = "\n".join(
        f"<tr{' class=group' if i in groups else ''}>{cells(row, 'td')}</tr>" for i, row in enumerate(rows)
    )
    top = f"<thead><tr>{cells(head, 'th')}</tr></thead>"
    return f'<div class="scroll"><table>\n{top}\n<tbody>\n{body}\n</tbody></table></div>'


def colored(text: str, ink: str) -> str:
    """A name in the colour of its curve."""
    return f'<b style="color:{ink}">{escape(text)}</b>'


class _Drawn:
    """A section's figure: as an element of the page, and as pixels for the sheet of all figures."""

    def __init__(self, section: Section, width: float) -> None:
        assert section.figure is not None
        figure = Figure(figsize=(width, section.height), layout="constrained")
        section.figure(figure)
        self.title = section.title
        dots = 1.4 * DOTS if section.raster else DOTS
        self.pixels = _pixels(figure, dots)
        # The layout is found: what follows need not look for it again.
        figure.set_layout_engine("none")
        if section.raster:
            kind, content = "png", _fewer_colors(self.pixels)
        else:
            buffer = io.BytesIO()
            style: Any = {"svg.fonttype": "path", "svg.hashsalt": section.title}
            with matplotlib.rc_context(style):
                figure.savefig(buffer, format="svg", metadata={"Date": None})
            kind, content = "svg+xml", buffer.getvalue()
        code = base64.b64encode(content).decode("ascii")
        alt = escape(section.alt or section.title, quote=True)
        self.tag = f'<img src="data:image/{kind};base64,{code}" alt="{alt}">'


def _poster(path: Path, title: str, drawn: Sequence[_Drawn], width: float) -> None:
    """All figures on one sheet."""
    parts = [_title(title, width, 0.6, 17)]
    for one in drawn:
        parts += [_title(one.title, width, 0.45, 13), one.pixels]
    across = round(width * DOTS)
    parts = [p if p.width == across else p.resize((across, round(p.height * across / p.width))) for p in parts]
    sheet = Image.new("RGB", (across, sum(p.height for p in parts)), PAPER)
    below = 0
    for part in parts:
        sheet.paste(part, (0, below))
        below += part.height
    path.write_bytes(_fewer_colors(sheet))


def _title(text: str, width: float, height: float, size: float) -> Image.Image:
    figure = Figure(figsize=(width, height))
    figure.text(0.012, 0.25, text, fontsize=size, fontweight="bold")
    return _pixels(figure, DOTS)


def _pixels(figure: Figure, dots: float) -> Image.Image:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dots)
    return Image.open(buffer).convert("RGB")


def _fewer_colors(picture: Image.Image) -> bytes:
    """A PNG with 256 colours, a third as long."""
    smaller = io.BytesIO()
    picture.quantize(256, dither=Image.Dither.NONE).save(smaller, "png", optimize=True)
    return smaller.getvalue()


def document(
    title: str,
    lead: str,
    points: Sequence[str],
    sections: Sequence[Section],
    pictures: Sequence[str],
    notes: Sequence[str],
) -> str:
    body = [f"<h1>{escape(title)}</h1>", f'<p class="lead">{lead}</p>']
    if points:
        body.append('<ul class="points">' + "".join(f"<li>{p}</li>" for p in points) + "</ul>")
    for section, picture in zip(sections, pictures, strict=True):
        body += [f"<h2>{escape(section.title)}</h2>", section.text, picture, section.table]
    if notes:
        body.append('<h2>Notes</h2><ul class="notes">' + "".join(f"<li>{n}</li>" for n in notes) + "</ul>")
    body.append(f"<footer>tumble {escape(version)}</footer>")
    head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>{head}\n'
        f"<title>{escape(title)}</title>\n<style>{_CSS}</style></head>\n"
        f"<body><main>\n{chr(10).join(body)}\n</main></body></html>\n"
    )


def _csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    names = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names, restval="")
        writer.writeheader()
        writer.writerows(rows)
