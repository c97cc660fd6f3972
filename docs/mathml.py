"""Typesets the equations of the site's pages, which mkdocs.yml calls for each: a browser needs no script for MathML.

A block ```math is LaTeX, as on GitHub. In the text of the method, φ_i has an index, and e^{−t} an exponent.
"""

from __future__ import annotations

import re
from typing import Any

from latex2mathml.converter import convert

MATH = re.compile(r"^```math\n(.*?)^```$", re.DOTALL | re.MULTILINE)
AS_IT_IS = re.compile(r"(^```.*?^```$|`[^`]*`|\]\([^)]*\)|<div class=\"math\">.*?</div>)", re.DOTALL | re.MULTILINE)
INDEX = re.compile(r"(?<=[^\s_])_(?:\{([^}]*)\}|([A-Za-z0-9]{1,2}))(?![A-Za-z0-9_])")
POWER = re.compile(r"\^(?:\{([^}]*)\}|\(([^)]*)\)|(±?[a-z0-9.]+))")
PAGE = "docs/method.md"


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """A page with its equations as MathML."""
    typeset = MATH.sub(lambda found: f'<div class="math">{convert(found[1].strip(), display="block")}</div>', markdown)
    if page.file.src_uri != PAGE:
        return typeset
    parts = AS_IT_IS.split(typeset)
    for number in range(0, len(parts), 2):
        indexed = INDEX.sub(lambda found: f"<sub>{found[1] or found[2]}</sub>", parts[number])
        parts[number] = POWER.sub(lambda found: f"<sup>{found[1] or found[2] or found[3]}</sup>", indexed)
    return "".join(parts)
