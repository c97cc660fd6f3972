"""The reference is what the code says: every key, command, option and call is in it."""

from __future__ import annotations

import runpy

from places import ROOT

DOCS = ROOT / "docs"


def test_reference_is_what_the_code_says() -> None:
    """Write it anew with `python docs/reference.py`; what a new key means is to be said in docs/keys.toml."""
    text = (DOCS / "reference.md").read_text(encoding="utf-8")
    assert runpy.run_path(str(DOCS / "reference.py"))["page"](text) == text
