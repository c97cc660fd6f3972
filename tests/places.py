"""Where the repository is, and how its command is called in a process of its own."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
METAID = (sys.executable, "-c", "from metaid.cli import main; main()")  # the command, in this very environment
