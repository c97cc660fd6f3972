"""Runs all benchmarks, each in a process of its own, and writes what they found to BENCHMARKS.md.

python -m benchmarks [--quick] [-o FILE.md]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path

from benchmarks.common import machine, table

NAMES = ("engine", "study", "overhead", "workers", "fits", "showing")
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}  # for the scripts that metaid is compared with; metaid sees to it itself


def main() -> None:
    """Everything in one run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks")
    parser.add_argument("--quick", action="store_true", help="fewer repeats and sizes: to see that it works")
    parser.add_argument("-o", dest="output", type=Path, default=Path("BENCHMARKS.md"), help="where the tables go")
    arguments = parser.parse_args()
    begun, before = time.perf_counter(), machine()
    parts = [_part(name, arguments.quick) for name in NAMES]
    minutes = (time.perf_counter() - begun) / 60
    facts = "\n".join(f"- {key}: {value}" for key, value in before.items())
    head = f"""# Benchmarks

Written by `make bench`, in one run of {minutes:.1f} minutes on {datetime.now(UTC):%Y-%m-%d}{
        ", with --quick: not to be quoted" if arguments.quick else ""
    }.
Figures are medians; what is compared took turns. Each part alone: `python -m benchmarks.engine [--quick] [--json]`,
and so on. An idle machine with two cores or more is wanted: the load before says whether it was one.

{facts}
"""
    arguments.output.write_text("\n".join([head, *parts]), encoding="utf-8")
    print(f"{arguments.output} is written")


def _part(name: str, quick: bool) -> str:
    print(f"{name} …", flush=True)
    command = [sys.executable, "-m", f"benchmarks.{name}", "--json", *(["--quick"] if quick else [])]
    done = subprocess.run(command, env={**os.environ, **ONE_THREAD}, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"benchmarks.{name} failed:\n{done.stderr}")
    found = json.loads(done.stdout)
    del found["machine"]
    about = (import_module(f"benchmarks.{name}").__doc__ or "").strip()
    return f"## {name}\n\n{about}\n\n" + "\n".join(f"**{title}**\n\n{table(rows)}\n" for title, rows in found.items())


if __name__ == "__main__":
    main()
