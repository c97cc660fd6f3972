"""Draws docs/images/three-link.svg: what `metaid study run three-link` prints.

Run it as `.venv/bin/python docs/screenshot.py`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from rich.console import Console
from rich.text import Text

IMAGE = Path(__file__).parent / "images" / "three-link.svg"


def main() -> None:
    """Creates and runs the study in an empty folder and draws its output as a terminal would."""
    console = Console(record=True, width=92, file=open(os.devnull, "w"))  # noqa: SIM115
    with tempfile.TemporaryDirectory() as folder:
        for command in ("study create three-link", "study run three-link"):
            program = [sys.executable, "-c", "from metaid.cli import main; main()", *command.split()]
            output = subprocess.run(program, cwd=folder, check=True, capture_output=True, text=True).stdout
            console.print(Text(f"$ metaid {command}", style="bold green"))
            console.print(Text.from_ansi(output.rstrip()))
    svg = console.export_svg(title="metaid")
    IMAGE.write_text(re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL))  # no font is fetched from outside


if __name__ == "__main__":
    main()
