"""Self-contained HTML pages: nothing is fetched, every value is escaped, figures are inline SVG.

Colours follow the reader's light or dark preference: matplotlib's ink becomes the page's. Each figure is there twice,
as wide as a page and as a phone, and the style sheet shows the one that fits.
"""

from __future__ import annotations

import io
import platform
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

import metaid
from metaid.frames import NO_ERROR, UNKNOWN, number_text
from metaid.show.figures import INK, laid_out, said_in, style, with_titles
from metaid.show.figures.gallery import Pictures
from metaid.show.figures.style import WIDTHS

VERSIONS_OF = ("mujoco-core", "numba", "numpy", "cmaes", "optuna", "matplotlib")
Watch = Callable[[str], None]


@dataclass(frozen=True)
class PageFigure:
    """A figure ready for the page: `wide` and `narrow` SVG."""

    name: str
    caption: str
    wide: Markup
    narrow: Markup


def filled_in(template: str, **values: Any) -> str:
    """A page made of a `template` of this package and these `values`; what they say is escaped."""
    versions = {"metaid": metaid.__version__, "Python": platform.python_version()}
    versions |= {package: metadata.version(package) for package in VERSIONS_OF}
    page: str = templates().get_template(template).render({"versions": versions, **values})
    return with_contents(re.sub(r"<table.*?</table>", _labelled, page, flags=re.DOTALL))


def with_contents(page: str) -> str:
    """A page with a list of its sections below its header."""
    sections = re.findall(r'<section id="([\w-]+)">\s*<h2>(.*?)</h2>', page)
    links = " ".join(f'<a href="#{name}">{title}</a>' for name, title in sections)
    return page.replace("</header>", f'</header>\n<nav id="contents" aria-label="Contents">{links}</nav>', 1)


def templates() -> Environment:
    """Those of this package, in which every value is escaped."""
    environment = Environment(
        loader=PackageLoader("metaid.show", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number_text, "percent": percent_text, "sentence": sentence}
    return environment


def _labelled(table: re.Match[str]) -> str:
    """A table whose cells say of which column they are: a phone shows them below one another."""
    if "<thead>" not in table[0]:
        return table[0]
    headings = re.findall(r"<th>(.*?)</th>", table[0].partition("</thead>")[0])

    def row(found: re.Match[str]) -> str:
        names = iter(headings)
        return re.sub("<td>", lambda _: f'<td data-label="{next(names)}">', found[0])

    return re.sub(r"<tr>(<td>.*?)</tr>", row, table[0], flags=re.DOTALL)


def page_figures(gallery: Pictures, watch: Watch = lambda what: None) -> list[PageFigure]:
    """All figures of a `gallery`, ready for the page; `watch` is told of each."""
    drawn: list[PageFigure] = []
    for name in gallery.makers:
        watch(f"figure {len(drawn) + 1}, {name}")
        wide, narrow = (gallery.picture(name, width) for width in WIDTHS)
        drawn.append(page_figure(name, wide.caption, [wide.figure, narrow.figure]))
    return drawn


def page_figure(name: str, caption: str, drawn: Iterable[Figure]) -> PageFigure:
    """A figure that is `drawn` as wide as a page and as a column, ready for the page."""
    wide, narrow = drawn
    return PageFigure(name, caption, inline_svg(wide, f"{name}-wide-"), inline_svg(narrow, f"{name}-narrow-"))


def inline_svg(figure: Figure, prefix: str) -> Markup:
    """A figure as SVG to stand in a page: no XML head, ids that begin with `prefix`, ink that the page chooses; values
    are shown where a mark is pointed at.
    """
    buffer, said = io.BytesIO(), said_in(figure)
    with style(), laid_out(figure, "svg"):
        figure.savefig(buffer, format="svg", facecolor="none", metadata={"Date": None})
    text = with_titles(buffer.getvalue().decode(), said)
    svg = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    svg = re.sub(r'\bid="', f'id="{prefix}', svg)
    svg = re.sub(r'(url\(#|href="#)', rf"\g<1>{prefix}", svg)
    # Its own output: no part of it but numbers and the study's checked names, which matplotlib has escaped.
    return Markup(svg.replace(INK, "currentColor"))


def sentence(text: str) -> str:
    """A text that begins with a capital letter and ends with a full stop."""
    return f"{text[:1].upper()}{text[1:]}."


def percent_text(share: float | None) -> str:
    """A share as a percentage of two digits for the page, however large; 0 where it is what rounding left, a dash where
    it is not known.
    """
    if share is None:
        return UNKNOWN
    return f"{float(f'{100.0 * share:.2g}'):g}%" if abs(share) >= NO_ERROR else "0%"
