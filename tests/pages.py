"""What every page that metaid writes has to hold: whole in a browser at every width, and able to repeat its study."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from browser import Browser
from conftest import Finished

LOOKS = ((360, True), (768, False), (1440, False))  # width in pixels, and whether the reader prefers dark
PAPER = {True: "rgb(22, 23, 27)", False: "rgb(255, 255, 255)"}


def seen_everywhere(browser: Browser, page: Path, figures: int) -> Iterator[str]:
    """What can be read of a `page` on a phone in the dark, a tablet and a desk, one after another, and on paper in the
    end. Everywhere there are so many `figures`, each is 200 pixels high at least, no text is cut or over another,
    nothing is wider than the page, nothing comes from outside, and nothing is complained of.
    """
    for width, dark in LOOKS:
        browser.look(page.as_uri(), width, dark)
        assert (width, browser.badly_laid_out()) == (width, [])
        assert browser.figures() == figures
        assert browser.driver.execute_script("return document.documentElement.scrollWidth - window.innerWidth") <= 0
        paper = browser.driver.execute_script("return getComputedStyle(document.body).backgroundColor")
        assert paper == PAPER[dark]
        assert browser.fetched() == [page.as_uri()]
        assert browser.complaints() == []
        yield browser.text()
    browser.print()
    assert ("print", browser.badly_laid_out()) == ("print", [])


def repeat(metaid: Callable[..., Finished], page: Path) -> list[str]:
    """Saves the files that a `page` has, and runs the commands that it says; the names of the files."""
    text = page.read_text(encoding="utf-8")
    files = re.findall(r'<pre class="file" data-name="([^"]+)">(.*?)</pre>', text, flags=re.DOTALL)
    for name, content in files:
        Path(name).write_text(html.unescape(content))
    (commands,) = re.findall(r'<pre id="commands">(.*?)</pre>', text, flags=re.DOTALL)
    for command in html.unescape(commands).splitlines():
        assert metaid(*command.split()[1:]).status == 0
    return [name for name, _ in files]


def ids_are_single(page: Path) -> bool:
    """Whether no id is there twice."""
    ids = re.findall(r'\bid="([^"]+)"', page.read_text(encoding="utf-8"))
    return len(ids) == len(set(ids))
