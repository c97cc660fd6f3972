"""How long `metaid study show` of a study that has ended takes from a cold start, beside `python -c "import optuna"`.

The estimate is read from the DB. Each command is a process of its own.
"""

from __future__ import annotations

import subprocess
import sys
from functools import partial

from benchmarks.common import Row, interleaved, made, run_alone
from metaid.study import load_study, run_study

STUDIES = "three-link", "pa10"
TURNS = 15
OPTUNA = [sys.executable, "-c", "import optuna"]
SHOW = [sys.executable, "-c", "from metaid.cli import main; main()", "study", "show"]


def measure(quick: bool) -> dict[str, list[Row]]:
    """The table."""
    return {"Show: seconds of a process, and its ratio to that of importing Optuna": [_row(n, quick) for n in STUDIES]}


def _row(study: str, quick: bool) -> Row:
    with made(load_study(study)) as (store, name):
        run_study(store, name)
        commands = {"show": [*SHOW, name, "--storage", store.url], "optuna": OPTUNA}
        works = {key: partial(subprocess.run, each, check=True, capture_output=True) for key, each in commands.items()}
        taken = interleaved(works, 2 if quick else TURNS)
    return {
        "study": study,
        "study show, s": taken["show"],
        "import optuna, s": taken["optuna"],
        "show ÷ import": taken["show"] / taken["optuna"],
    }


if __name__ == "__main__":
    run_alone("showing", measure)
