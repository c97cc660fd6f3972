"""Writes the pages of the site, from which `make docs` makes HTML as mkdocs.yml says.

    python docs/pages.py FOLDER

Pages keep the places that they have in the repository, so that their links hold. Notebooks become pages with their
stored outputs, and `api.md` lists all that `import metaid` offers. Anchors of headings are those of GitHub. This needs
no package, and another generator could read the folder.
"""

from __future__ import annotations

import ast
import base64
import html
import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
PAGES = ("*.md", "docs/*.md", "logs/*/README.md")
FILES = (
    "LICENSE",
    "logs/*/LICENSE",
    "docs/keys.toml",
    "docs/images/*",
    "docs/site.css",
    "docs/iframe-worker.js",
    "examples/*.py",
)
FENCE = re.compile(r"(^```.*?^```$)", re.DOTALL | re.MULTILINE)
COMMENT = re.compile(r"<!--.*?-->\n?", re.DOTALL)
HEADING = re.compile(r"^(#{1,6}) (.+)$", re.MULTILINE)
BEFORE_A_LIST = re.compile(r"^(?![-*|>#\s]|\d+\. )(.*\S)\n(?=(?:[-*]|\d+\.) )", re.MULTILINE)


def write_pages(folder: Path) -> None:
    """All pages, and the files that they refer to."""
    for pattern in PAGES:
        for path in sorted(ROOT.glob(pattern)):
            put(folder / path.relative_to(ROOT), page(path.read_text(encoding="utf-8")))
    for pattern in FILES:
        for path in sorted(ROOT.glob(pattern)):
            (folder / path.relative_to(ROOT)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, folder / path.relative_to(ROOT))
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        text, pictures = notebook(json.loads(path.read_text(encoding="utf-8")), path.stem)
        put(folder / "notebooks" / f"{path.stem}.md", page(text))
        for name, content in pictures.items():
            (folder / "notebooks" / name).write_bytes(content)
    put(folder / "api.md", api((ROOT / "metaid" / "__init__.py").read_text(encoding="utf-8")))


def put(path: Path, text: str) -> None:
    """A page in its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def page(text: str) -> str:
    """A page as Python's Markdown reads it where GitHub reads it otherwise: a list after a line of text, comments,
    anchors; a notebook is a page.
    """
    parts = FENCE.split(text)
    for index in range(0, len(parts), 2):
        plain = BEFORE_A_LIST.sub(r"\1\n\n", COMMENT.sub("", parts[index]))
        plain = re.sub(r"(notebooks/[\w-]+)\.ipynb\)", r"\1.md)", plain)
        parts[index] = HEADING.sub(lambda found: f"{found[0]} {{: #{anchor(found[2])} }}", plain)
    return "".join(parts)


def anchor(heading: str) -> str:
    """Letters and figures in lower case, with a hyphen for each blank, as GitHub does."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def notebook(content: dict[str, Any], name: str) -> tuple[str, dict[str, bytes]]:
    """A notebook as Markdown, and its pictures by file name."""
    parts: list[str] = []
    pictures: dict[str, bytes] = {}
    for cell in content["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for output in cell.get("outputs", []):
            shown = output.get("data", {})
            if "image/png" in shown:
                picture = f"{name}-{len(pictures) + 1}.png"
                pictures[picture] = base64.b64decode("".join(shown["image/png"]))
                parts.append(f"![What the cell above draws]({picture})")
            elif "text/html" in shown:
                table = re.sub(r"<style.*?</style>|\n\s*", "", "".join(shown["text/html"]), flags=re.DOTALL)
                parts.append(f'<div class="printed">{table}</div>')
            else:
                text = "".join(output.get("text", shown.get("text/plain", "")))
                parts.append(f'<pre class="printed">{html.escape(text)}</pre>')
    return "\n\n".join(parts) + "\n", pictures


def api(source: str) -> str:
    """A page of all public names, for mkdocstrings; `source` is that of the package."""
    (names,) = [
        ast.literal_eval(node.value)
        for node in ast.parse(source).body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
    ]
    calls = [name for name in names if name.islower() and name != "figures"]
    classes = [name for name in names if not name.islower()]
    title = "# Python\n\nWhat `import metaid` offers, as the docstrings say.\n"
    parts = [f"{title}", *(f"::: metaid.{name}" for name in calls), *(f"::: metaid.{name}" for name in classes)]
    return "\n\n".join([*parts, "::: metaid.show.figures"]) + "\n"


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
