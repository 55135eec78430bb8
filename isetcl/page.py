"""Self-contained HTML pages of text, pictures and tables that sort themselves without a network."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 1180px; margin: 2em auto;
  padding: 0 1em; }
h1 { font-size: 1.6em; margin-bottom: 0.2em; } h2 { font-size: 1.2em; margin-top: 2em; }
img { max-width: 100%; height: auto; } figure { margin: 1em 0; }
figcaption, caption { color: #555; font-size: 0.92em; text-align: left; }
table { border-collapse: collapse; } th, td { padding: 0.3em 0.9em; text-align: right;
  border-bottom: 1px solid #ddd; vertical-align: top; }
th:first-child, td:first-child { text-align: left; }
table:not(.words) td { white-space: nowrap; }
table.words { width: 100%; } table.words th, table.words td { text-align: left; }
th { font-weight: 600; } th button { all: unset; cursor: pointer; }
th button:focus-visible { outline: 2px solid #36c; }
th[aria-sort=ascending] button::after { content: " \\25B2"; }
th[aria-sort=descending] button::after { content: " \\25BC"; }
pre { background: #f6f6f6; padding: 0.8em; overflow-x: auto; font-size: 0.82em; }
.lead { color: #444; } .wide { overflow-x: auto; } nav a { margin-right: 1.2em; }
.good { color: #176b2c; } .bad { color: #b3261e; font-weight: 600; }
"""

# A click sorts by a column, another one the other way; numbers by their value, words by letters.
_SORTING = """
for (const button of document.querySelectorAll("th button")) {
  button.addEventListener("click", () => {
    const head = button.closest("th"), row = head.parentNode;
    const body = head.closest("table").tBodies[0];
    const column = [...row.cells].indexOf(head);
    const up = head.getAttribute("aria-sort") !== "ascending";
    for (const cell of row.cells) cell.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    const value = (tr) => {
      const text = tr.cells[column].textContent.trim(), number = parseFloat(text.replace(/^~/, ""));
      return Number.isNaN(number) ? text : number;
    };
    const order = (a, b) => {
      const x = value(a), y = value(b);
      if (typeof x !== typeof y) return typeof x === "number" ? -1 : 1;
      return (x < y ? -1 : x > y ? 1 : 0) * (up ? 1 : -1);
    };
    for (const tr of [...body.rows].sort(order)) body.append(tr);
  });
}
"""


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    words: str

    def markup(self) -> str:
        """As HTML."""
        return f"<p>{html.escape(self.words)}</p>"


@dataclass(frozen=True)
class Listing:
    """Lines of fixed width."""

    words: str

    def markup(self) -> str:
        """As HTML."""
        return f"<pre>{html.escape(self.words)}</pre>"


@dataclass(frozen=True)
class Picture:
    """A PNG picture and what it shows."""

    png: bytes
    caption: str

    def markup(self) -> str:
        """As HTML, the picture inline."""
        data, words = base64.b64encode(self.png).decode(), html.escape(self.caption)
        return (
            f'<figure><img alt="{words}" src="data:image/png;base64,{data}">'
            f"<figcaption>{words}</figcaption></figure>"
        )


@dataclass(frozen=True)
class Table:
    """A table that sorts by the column whose head is clicked.

    Parameters
    ----------
    head, rows
        Names of the columns; cells of the rows.
    caption
        What stands above it.
    is_wordy
        Whether columns hold words, set to the left, and not numbers.
    verdicts
        Words of a cell that are good news, and those that are bad.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    is_wordy: bool = False
    verdicts: tuple[Sequence[str], Sequence[str]] = ((), ())

    def markup(self) -> str:
        """As HTML."""
        head = "".join(
            f'<th><button type="button">{html.escape(name)}</button></th>' for name in self.head
        )
        body = "".join(f"<tr>{''.join(map(self._cell, row))}</tr>" for row in self.rows)
        words = f"<caption>{html.escape(self.caption)}</caption>" if self.caption else ""
        kind = ' class="words"' if self.is_wordy else ""
        return (
            f'<div class="wide"><table{kind}>{words}<thead><tr>{head}</tr></thead>'
            f"<tbody>{body}</tbody></table></div>"
        )

    def _cell(self, words: str) -> str:
        good, bad = self.verdicts
        kind = ' class="good"' if words in good else ' class="bad"' if words in bad else ""
        return f"<td{kind}>{html.escape(words)}</td>"


Block = Text | Listing | Picture | Table


def page(
    title: str,
    heading: str,
    lead: str,
    sections: Sequence[tuple[str, Sequence[Block]]],
    *,
    has_contents: bool = False,
    closing: str = "",
) -> str:
    """A page as one HTML text that needs no other file and no network.

    Parameters
    ----------
    title, heading, lead
        Of the window; above the page; the line below it.
    sections
        Headings and what stands under them.
    has_contents
        Whether links to the sections stand at the top.
    closing
        The last line.
    """
    names = [f"part-{i + 1}" for i in range(len(sections))]
    links = "".join(
        f'<a href="#{name}">{html.escape(words)}</a>'
        for name, (words, _) in zip(names, sections, strict=True)
    )
    content = "".join(
        f'<h2 id="{name}">{html.escape(words)}</h2>{"".join(b.markup() for b in blocks)}'
        for name, (words, blocks) in zip(names, sections, strict=True)
    )
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style></head>"
        f'<body><h1>{html.escape(heading)}</h1><p class="lead">{html.escape(lead)}</p>'
        f"{f'<nav>{links}</nav>' if has_contents else ''}{content}"
        f'<p class="lead">{html.escape(closing)}</p><script>{_SORTING}</script></body></html>'
    )


def png_of(figure: Figure, dpi: int = 120) -> bytes:
    """A matplotlib figure as a PNG file; the figure is closed."""
    import matplotlib.pyplot as plt

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, bbox_inches="tight")
    plt.close(figure)
    return buffer.getvalue()
